#include "antipode/util/temporary_folder.h"

#include <stdlib.h>

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

}  // namespace antipode
