#include <cstdio>

#include <antipode/util/files.h>
#include <antipode/weights/registry.h>

/// Links the whole library and lists the models that were installed.
int main() {
  std::printf("models in %s\n", antipode::ModelsDirectory().c_str());
  for (const antipode::ModelEntry& model : antipode::ListModels()) {
    std::printf("model %s\n", model.name.c_str());
  }
  return 0;
}
