#include "antipode/weights/registry.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <nlohmann/json.hpp>

#include "antipode/util/error.h"
#include "antipode/util/files.h"
#include "antipode/util/quote.h"
#include "antipode/util/suggest.h"
#include "antipode/weights/check.h"

namespace antipode {
namespace {

namespace fs = std::filesystem;

constexpr char kDescriptionFile[] = "model.json";
constexpr char kTensorFile[] = "model.safetensors";
constexpr char kCardFile[] = "card.md";
constexpr char kReinstall[] = "install or import the model again";

/// A name that is also a safe name of a file.
bool IsPlainName(const std::string& name) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) || c == '.' || c == '_' || c == '-';
  };
  return !name.empty() && name.front() != '.' && std::ranges::all_of(name, is_plain);
}

/// In order of precedence.
std::vector<fs::path> ModelRoots() { return {ModelsDirectory(), UserDataDirectory() / "models"}; }

bool IsModelFolder(const fs::path& folder) {
  std::error_code error;
  return IsPlainName(folder.filename().string()) && fs::exists(folder / kDescriptionFile, error);
}

/// The model folders by name; what cannot be listed has none.
std::map<std::string, fs::path> FindFolders() {
  std::map<std::string, fs::path> folders;
  for (const fs::path& root : ModelRoots()) {
    std::error_code error;
    for (fs::directory_iterator entry(root, error), end; !error && entry != end;
         entry.increment(error)) {
      if (IsModelFolder(entry->path())) {
        folders.emplace(entry->path().filename().string(), entry->path());
      }
    }
  }
  return folders;
}

/// Reads the fields of a model.json, naming the one at fault.
class Description {
 public:
  explicit Description(const fs::path& path) : path_(path) {
    constexpr std::uintmax_t kMaxBytes = 1 << 20;
    std::error_code error;
    if (fs::file_size(path, error) > kMaxBytes && !error) {
      throw BadFile(path.string(), "is too large for a model.json", kReinstall);
    }
    object_ = nlohmann::json::parse(ReadFile(path), nullptr, false);
    if (!object_.is_object()) throw BadFile(path.string(), "is not a JSON object", kReinstall);
  }

  std::string Text(const char* field) const {
    const nlohmann::json& value = Field(field);
    if (!value.is_string()) Fail(field, "is not a text");
    return value.get<std::string>();
  }

  std::uint64_t Count(const char* field) const {
    const nlohmann::json& value = Field(field);
    if (!value.is_number_unsigned()) Fail(field, "is not a whole number");
    return value.get<std::uint64_t>();
  }

  [[noreturn]] void Fail(const char* field, const std::string& problem) const {
    throw BadFile(path_.string(), std::string("the field '") + field + "' " + problem, kReinstall);
  }

 private:
  const nlohmann::json& Field(const char* field) const {
    const auto found = object_.find(field);
    if (found == object_.end()) Fail(field, "is missing");
    return *found;
  }

  fs::path path_;
  nlohmann::json object_;
};

ModelEntry ReadEntry(const fs::path& folder) {
  const Description description(folder / kDescriptionFile);
  ModelEntry entry;
  entry.name = description.Text("name");
  entry.description = description.Text("description");
  entry.licence = description.Text("licence");
  entry.source = description.Text("source");
  entry.bytes = description.Count("bytes");
  entry.sha256 = description.Text("sha256");
  entry.tensor_count = description.Count("tensors");
  const std::string file = description.Text("file");
  if (entry.name != folder.filename()) description.Fail("name", "differs from the folder's name");
  if (!IsPlainName(file)) description.Fail("file", "is not the name of a file beside it");
  entry.file = folder / file;
  return entry;
}

[[noreturn]] void ThrowUnknownModel(const std::string& name) {
  std::vector<std::string> known;
  for (const auto& [known_name, folder] : FindFolders()) known.push_back(known_name);
  const std::string nearest = NearestName(name, known);
  const std::string remedy =
      known.empty() ? "there is none; import one, or set ANTIPODE_MODELS to the folder of models"
                    : (nearest.empty() ? "" : "did you mean '" + nearest + "'? ") +
                          "known models: " + JoinNames(known);
  throw Error("model " + Quoted(name), "is not known", remedy);
}

void CheckSizeAndHash(const ModelEntry& entry) {
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(entry.file, error);
  if (error) throw BadFile(entry.file.string(), "cannot be read", kReinstall);
  if (bytes != entry.bytes) {
    throw BadFile(
        entry.file.string(),
        "has " + std::to_string(bytes) + " bytes instead of " + std::to_string(entry.bytes),
        kReinstall);
  }
  const std::string sha256 = Sha256OfFile(entry.file);
  if (sha256 != entry.sha256) {
    throw BadFile(entry.file.string(),
                  "has the sha256 " + sha256 + " instead of " + Quoted(entry.sha256), kReinstall);
  }
}

SafetensorsReader OpenVerified(const ModelEntry& entry) {
  CheckSizeAndHash(entry);
  SafetensorsReader reader(entry.file);
  if (reader.tensors().size() != entry.tensor_count) {
    throw BadFile(entry.file.string(),
                  "has " + std::to_string(reader.tensors().size()) + " tensors instead of " +
                      std::to_string(entry.tensor_count),
                  kReinstall);
  }
  return reader;
}

std::string SourceOf(const std::map<std::string, std::string>& metadata) {
  const auto found = metadata.find("source");
  return found == metadata.end() ? "" : found->second;
}

/// A value that is not finite ends the reading.
LazyTensorFile CheckedWhenRead(const LazyTensorFile& file, const std::string& file_name) {
  LazyTensorFile checked = file;
  for (auto& [name, tensor] : checked.tensors) {
    tensor.read = [read = tensor.read, name = name, file_name] {
      HostTensor values = read();
      CheckFinite(values, name, file_name);
      return values;
    };
  }
  return checked;
}

std::string FormatDescription(const ModelEntry& entry) {
  const nlohmann::ordered_json description = {{"name", entry.name},
                                              {"description", entry.description},
                                              {"licence", entry.licence},
                                              {"file", entry.file.filename().string()},
                                              {"bytes", entry.bytes},
                                              {"sha256", entry.sha256},
                                              {"tensors", entry.tensor_count},
                                              {"source", entry.source}};
  try {
    return description.dump(2) + "\n";
  } catch (const nlohmann::json::exception&) {
    throw InvalidOption("description", "is not UTF-8 text");
  }
}

}  // namespace

std::vector<ModelEntry> ListModels() {
  std::vector<ModelEntry> entries;
  for (const auto& [name, folder] : FindFolders()) entries.push_back(ReadEntry(folder));
  return entries;
}

bool IsModelInstalled(const std::string& name) { return FindFolders().contains(name); }

ModelEntry FindModel(const std::string& name) {
  if (fs::exists(fs::path(name) / kDescriptionFile)) return ReadEntry(fs::absolute(name).lexically_normal());
  const std::map<std::string, fs::path> folders = FindFolders();
  const auto found = folders.find(name);
  if (found == folders.end()) ThrowUnknownModel(name);
  return ReadEntry(found->second);
}

void VerifyModel(const ModelEntry& entry) {
  const SafetensorsReader reader = OpenVerified(entry);
  for (const auto& [name, info] : reader.tensors()) {
    CheckFinite(reader.Read(name), name, entry.file.string());
  }
}

TensorFile LoadModel(const std::string& name) {
  const ModelEntry entry = FindModel(name);
  TensorFile tensors = OpenVerified(entry).ReadAll();
  CheckFinite(tensors, entry.file.string());
  return tensors;
}

LazyTensorFile OpenModel(const std::string& name) {
  const ModelEntry entry = FindModel(name);
  OpenVerified(entry);
  return CheckedWhenRead(OpenSafetensors(entry.file), entry.file.string());
}

ModelEntry SaveModel(const fs::path& directory, const std::string& name, const LazyTensorFile& tensors,
                     const std::string& description, const std::string& licence,
                     const std::string& card) {
  if (!IsPlainName(name)) {
    throw InvalidOption("name", Quoted(name) + " is not a model's name",
                        "use letters, digits, '.', '_' and '-'");
  }
  const fs::path folder = directory / name;
  ModelEntry entry;
  entry.name = name;
  entry.description = description;
  entry.licence = licence;
  entry.source = SourceOf(tensors.metadata);
  entry.file = folder / kTensorFile;
  entry.tensor_count = tensors.tensors.size();
  FormatDescription(entry);
  WriteSafetensors(entry.file, CheckedWhenRead(tensors, entry.file.string()));
  entry.bytes = fs::file_size(entry.file);
  entry.sha256 = Sha256OfFile(entry.file);
  WriteFileAtomically(folder / kCardFile, card);
  WriteFileAtomically(folder / kDescriptionFile, FormatDescription(entry));
  return entry;
}

ModelEntry SaveModel(const fs::path& directory, const std::string& name, const TensorFile& tensors,
                     const std::string& description, const std::string& licence,
                     const std::string& card) {
  CheckFinite(tensors, (directory / name / kTensorFile).string());
  return SaveModel(directory, name, LazyViewOf(tensors), description, licence, card);
}

}  // namespace antipode
