#include "antipode/util/temporary_folder.h"

#include <stdlib.h>

#include <fstream>
#include <cerrno>
#include <cstring>
#include <string>

#include "antipode/util/error.h"

namespace antipode {

TemporaryFolder::TemporaryFolder() {
  std::string name = std::filesystem::temp_directory_path() / "antipode-XXXXXX";
  if (!mkdtemp(name.data())) {
    throw Error(name, std::string("cannot be made (") + std::strerror(errno) + ")",
                "set TMPDIR to a folder that can be written to");
  }
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::filesystem::path TemporaryFolder::Write(const std::string& name, std::string_view bytes) const {
  std::ofstream(path_ / name, std::ios::binary) << bytes;
  return path_ / name;
}

}  // namespace antipode
