#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace antipode {

/// The whole file. @throws BadFile naming it if it is missing, a directory or unreadable
std::string ReadFile(const std::filesystem::path& path);

/// Lets `write` fill a temporary file in the same folder, flushes it to disk, then renames it to
/// `path`; on any failure the temporary file is removed and `path` is as before. Creates missing
/// folders. A symbolic link is followed, so that the file it points to is replaced.
/// @throws Error naming `path` if it cannot be written or is something else than a file; whatever
/// `write` throws
void WriteFileAtomically(const std::filesystem::path& path,
                         const std::function<void(std::ostream&)>& write);
void WriteFileAtomically(const std::filesystem::path& path, std::string_view content);

/// The files of `folder` whose names end in `extension` (".glb"), sorted.
/// @throws BadFile naming the folder if it is missing or holds none
std::vector<std::filesystem::path> FilesWithExtension(const std::filesystem::path& folder,
                                                      const std::string& extension);

/// SHA-256 as 64 lower-case hexadecimal digits.
std::string Sha256Hex(std::span<const std::byte> bytes);
std::string Sha256OfFile(const std::filesystem::path& path);

/// `$XDG_DATA_HOME/antipode`, else `$HOME/.local/share/antipode`, else the same in the account's
/// home folder.
/// @throws Error if there is no home folder
std::filesystem::path UserDataDirectory();

/// The folder `models` that ships with the program: `$ANTIPODE_MODELS`, else beside the installed
/// program
/// (`../share/antipode/models`), else in the source tree the program was built from.
std::filesystem::path ModelsDirectory();

}  // namespace antipode
