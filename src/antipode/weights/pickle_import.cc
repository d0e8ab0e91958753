#include "antipode/weights/pickle_import.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"
#include "antipode/weights/archive.h"
#include "antipode/weights/pickle_machine.h"

namespace antipode {
namespace {

constexpr std::uint64_t kMaxPickleBytes = 64 << 20;
constexpr std::size_t kMaxRank = 64;
constexpr std::size_t kMaxNameLength = 4000;
constexpr int kMaxNesting = 64;
constexpr int kMaxVisited = 1'000'000;
constexpr char kDamaged[] = "the file is damaged, get it again";
constexpr char kSaveStateDict[] = "save a state_dict with torch.save and give that file";

/// 0x1950a86a20f9469cfc6c, the first pickle of a legacy file.
constexpr std::string_view kLegacyMagic = "\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19";
constexpr std::int64_t kLegacyProtocol = 1001;

struct Storage {
  std::string key;
  Dtype dtype = Dtype::kF32;
  std::uint64_t elements = 0;
  bool operator==(const Storage&) const = default;

  std::uint64_t bytes() const { return elements * SizeOf(dtype); }
};

/// A strided view of a storage; offset and strides count elements.
struct StoredTensor {
  Storage storage;
  std::uint64_t offset = 0;
  std::vector<std::int64_t> shape;
  std::vector<std::int64_t> stride;
  std::uint64_t elements = 0;

  std::uint64_t bytes() const { return elements * SizeOf(storage.dtype); }
};

using StoredTensors = std::map<std::string, StoredTensor>;
using ReadStorage = std::function<std::vector<std::byte>(const Storage&)>;

std::optional<Dtype> DtypeOfStorage(std::string_view global) {
  static constexpr auto kStorages =
      std::to_array<std::pair<std::string_view, Dtype>>({{"torch.DoubleStorage", Dtype::kF64},
                                                         {"torch.FloatStorage", Dtype::kF32},
                                                         {"torch.HalfStorage", Dtype::kF16},
                                                         {"torch.BFloat16Storage", Dtype::kBF16},
                                                         {"torch.LongStorage", Dtype::kI64},
                                                         {"torch.IntStorage", Dtype::kI32},
                                                         {"torch.ShortStorage", Dtype::kI16},
                                                         {"torch.CharStorage", Dtype::kI8},
                                                         {"torch.ByteStorage", Dtype::kU8},
                                                         {"torch.BoolStorage", Dtype::kBool}});
  for (const auto& [name, dtype] : kStorages) {
    if (name == global) return dtype;
  }
  return std::nullopt;
}

/// ("storage", storage class, key, device, count of elements...)
bool IsStorageId(const PickleObject& id) {
  const auto& items = id.items;
  return id.kind == PickleKind::kTuple && items.size() >= 5 && items[0]->text == "storage" &&
         items[1]->kind == PickleKind::kGlobal && items[2]->kind == PickleKind::kText &&
         items[4]->kind == PickleKind::kInteger;
}

/// Nothing if its class is not supported or its size is impossible.
std::optional<Storage> ParseStorage(const PickleObject& id) {
  const std::optional<Dtype> dtype = DtypeOfStorage(id.items[1]->text);
  const std::int64_t elements = id.items[4]->integer;
  const std::int64_t most = std::numeric_limits<std::int64_t>::max() / 8;
  if (!dtype || elements < 0 || elements > most) return std::nullopt;
  return Storage{std::string(id.items[2]->text), *dtype, static_cast<std::uint64_t>(elements)};
}

/// Finds the tensors of an unpickled dictionary.
class Collector {
 public:
  Collector(std::string subject, const TensorFilter& is_wanted)
      : subject_(std::move(subject)), is_wanted_(is_wanted) {}

  StoredTensors Collect(const PickleObject& root) && {
    if (root.kind != PickleKind::kDict) {
      Fail("the top-level object is " + Describe(root) + " instead of a dictionary of tensors",
           kSaveStateDict);
    }
    VisitDict("", root, 0);
    if (!found_any_) Fail("has no tensors in its dictionaries", kSaveStateDict);
    return std::move(tensors_);
  }

 private:
  [[noreturn]] void Fail(const std::string& problem, const std::string& remedy = kDamaged) const {
    throw BadFile(subject_, problem, remedy);
  }

  static std::string Describe(const PickleObject& object) {
    if (object.kind == PickleKind::kGlobal) return "the global " + Quoted(object.text);
    if (object.kind == PickleKind::kList || object.kind == PickleKind::kTuple) return "a list";
    if (object.kind == PickleKind::kCall && object.items[0]->kind == PickleKind::kGlobal) {
      return "an object of " + Quoted(object.items[0]->text);
    }
    return "something else";
  }

  /// Nothing for keys that are neither text nor integer.
  std::optional<std::string> Join(const std::string& prefix, const PickleObject& key) const {
    std::string name = prefix.empty() ? "" : prefix + ".";
    if (key.kind == PickleKind::kInteger) return name + std::to_string(key.integer);
    if (key.kind != PickleKind::kText) return std::nullopt;
    if (name.size() + key.text.size() > kMaxNameLength) Fail("has an entry with too long a name");
    return name.append(key.text);
  }

  void VisitDict(const std::string& prefix, const PickleObject& dict, int nesting) {
    if (nesting > kMaxNesting) Fail("has dictionaries nested too deeply");
    std::map<std::string, const PickleObject*> values;
    for (std::size_t i = 0; i + 1 < dict.items.size(); i += 2) {
      if (++visited_ > kMaxVisited) Fail("has too many entries in its dictionaries");
      const std::optional<std::string> name = Join(prefix, *dict.items[i]);
      if (name) values[*name] = dict.items[i + 1];
    }
    for (const auto& [name, value] : values) {
      if (value->kind == PickleKind::kDict) VisitDict(name, *value, nesting + 1);
      if (value->kind == PickleKind::kCall) VisitCall(name, *value);
    }
  }

  void VisitCall(const std::string& name, const PickleObject& call) {
    const PickleObject* const tensor = FindTensorCall(name, call, 0);
    if (!tensor) return;
    found_any_ = true;
    if (!is_wanted_(name)) return;
    if (!tensors_.emplace(name, ReadTensor(name, *tensor)).second) {
      Fail("has two tensors named " + Quoted(name));
    }
  }

  /// The call that makes the tensor, inside the one that makes a parameter of it if there is one;
  /// null if `call` makes something else.
  const PickleObject* FindTensorCall(const std::string& name, const PickleObject& call,
                                     int nesting) const {
    const PickleObject& callable = *call.items[0];
    if (callable.kind != PickleKind::kGlobal) return nullptr;
    if (callable.text == "torch._utils._rebuild_tensor_v2" ||
        callable.text == "torch._utils._rebuild_tensor") {
      return &call;
    }
    if (callable.text == "torch._utils._rebuild_parameter") {
      const auto& arguments = call.items[1]->items;
      const bool has_tensor = !arguments.empty() && arguments[0]->kind == PickleKind::kCall;
      if (!has_tensor || nesting > 0) Fail("parameter " + Quoted(name) + " is malformed");
      return FindTensorCall(name, *arguments[0], nesting + 1);
    }
    const bool makes_other_tensor = callable.text.starts_with("torch._utils._rebuild") ||
                                    callable.text.starts_with("torch._tensor._rebuild");
    if (makes_other_tensor) {
      Fail("tensor " + Quoted(name) + " is made by the unsupported global " +
               Quoted(callable.text) + "; nothing was executed",
           "save it as an ordinary dense tensor");
    }
    return nullptr;
  }

  StoredTensor ReadTensor(const std::string& name, const PickleObject& call) {
    const auto& arguments = call.items[1]->items;
    if (arguments.size() < 4) Fail("tensor " + Quoted(name) + " is malformed");
    StoredTensor tensor;
    tensor.storage = ReadStorage(name, *arguments[0]);
    tensor.offset = ReadCount(name, *arguments[1]);
    tensor.shape = ReadCounts(name, *arguments[2]);
    tensor.stride = ReadCounts(name, *arguments[3]);
    CheckBounds(name, tensor);
    return tensor;
  }

  Storage ReadStorage(const std::string& name, const PickleObject& object) {
    const bool is_storage = object.kind == PickleKind::kPersistent && IsStorageId(*object.items[0]);
    if (!is_storage) Fail("tensor " + Quoted(name) + " has no storage or a malformed one");
    const PickleObject& id = *object.items[0];
    const bool is_view = id.items.size() > 5 && id.items[5]->kind != PickleKind::kNone;
    if (is_view) {
      Fail("tensor " + Quoted(name) + " lies in a view of a storage, as torch < 0.4 wrote them",
           "load and save it with a newer torch");
    }
    const std::optional<Storage> parsed = ParseStorage(id);
    if (!parsed) {
      Fail("tensor " + Quoted(name) + " has the unsupported storage " + Quoted(id.items[1]->text),
           "convert it to an ordinary number format");
    }
    const Storage& storage = *parsed;
    const auto [known, is_new] = storages_.emplace(storage.key, storage);
    if (!is_new && known->second != storage) {
      Fail("tensor " + Quoted(name) + " contradicts another one about their common storage");
    }
    return storage;
  }

  std::uint64_t ReadCount(const std::string& name, const PickleObject& object) const {
    if (object.kind != PickleKind::kInteger || object.integer < 0) {
      Fail("tensor " + Quoted(name) + " has an impossible size, stride or offset");
    }
    return static_cast<std::uint64_t>(object.integer);
  }

  std::vector<std::int64_t> ReadCounts(const std::string& name, const PickleObject& tuple) const {
    const bool is_tuple = tuple.kind == PickleKind::kTuple && tuple.items.size() <= kMaxRank;
    if (!is_tuple) Fail("tensor " + Quoted(name) + " has an impossible shape");
    std::vector<std::int64_t> counts;
    for (const PickleObject* const item : tuple.items) {
      counts.push_back(static_cast<std::int64_t>(ReadCount(name, *item)));
    }
    return counts;
  }

  /// Sets `elements`; every index must lie in the storage.
  void CheckBounds(const std::string& name, StoredTensor& tensor) const {
    if (tensor.shape.size() != tensor.stride.size()) {
      Fail("tensor " + Quoted(name) + " has a different number of sizes and strides");
    }
    const bool is_empty = std::ranges::find(tensor.shape, 0) != tensor.shape.end();
    std::uint64_t elements = 1;
    std::uint64_t last = tensor.offset;
    bool overflows = false;
    for (std::size_t i = 0; i < tensor.shape.size(); ++i) {
      const auto size = static_cast<std::uint64_t>(std::max<std::int64_t>(tensor.shape[i], 1));
      std::uint64_t reach = 0;
      overflows |= __builtin_mul_overflow(elements, size, &elements);
      overflows |= __builtin_mul_overflow(size - 1, tensor.stride[i], &reach);
      overflows |= __builtin_add_overflow(last, reach, &last);
    }
    // Zero strides can multiply a small storage without end.
    if (overflows || elements > std::numeric_limits<std::int64_t>::max() / 8) {
      Fail("tensor " + Quoted(name) + " has an impossible shape");
    }
    if (is_empty) return;
    if (last >= tensor.storage.elements) {
      Fail("tensor " + Quoted(name) + " reaches beyond its storage");
    }
    tensor.elements = elements;
  }

  std::string subject_;
  const TensorFilter& is_wanted_;
  StoredTensors tensors_;
  std::map<std::string, Storage> storages_;
  int visited_ = 0;
  bool found_any_ = false;
};

bool IsContiguous(const StoredTensor& tensor) {
  std::int64_t expected = 1;
  for (std::size_t i = tensor.shape.size(); i-- > 0;) {
    if (tensor.shape[i] == 1) continue;
    if (tensor.stride[i] != expected) return false;
    expected *= tensor.shape[i];
  }
  return true;
}

/// Calls `copy` with the storage index of every element, in row-major order.
template <typename Copy>
void ForEachElement(const StoredTensor& tensor, Copy copy) {
  std::vector<std::int64_t> index(tensor.shape.size(), 0);
  std::uint64_t position = tensor.offset;
  for (std::uint64_t i = 0; i < tensor.elements; ++i) {
    copy(position);
    for (std::size_t axis = index.size(); axis-- > 0;) {
      position += static_cast<std::uint64_t>(tensor.stride[axis]);
      if (++index[axis] < tensor.shape[axis]) break;
      position -= static_cast<std::uint64_t>(tensor.stride[axis] * tensor.shape[axis]);
      index[axis] = 0;
    }
  }
}

std::vector<std::byte> CopyView(const StoredTensor& tensor, const std::vector<std::byte>& storage) {
  const std::size_t size = SizeOf(tensor.storage.dtype);
  if (tensor.elements == 0) return {};
  if (IsContiguous(tensor)) {
    const auto begin = storage.begin() + static_cast<std::ptrdiff_t>(tensor.offset * size);
    return {begin, begin + static_cast<std::ptrdiff_t>(tensor.bytes())};
  }
  std::vector<std::byte> view(tensor.bytes());
  std::byte* target = view.data();
  ForEachElement(tensor, [&](std::uint64_t position) {
    std::memcpy(target, storage.data() + position * size, size);
    target += size;
  });
  return view;
}

bool IsWholeStorage(const StoredTensor& tensor) {
  return tensor.elements == tensor.storage.elements && tensor.offset == 0 && IsContiguous(tensor);
}

void CheckTotalSize(const StoredTensors& tensors, const InputFile& file) {
  const std::uint64_t limit = UnpackedLimit(file.size());
  std::uint64_t total = 0;
  for (const auto& [name, tensor] : tensors) {
    if (tensor.bytes() > limit - total || tensor.storage.bytes() > limit) {
      throw BadFile(file.subject(), "describes far more numbers than the file can hold", kDamaged);
    }
    total += tensor.bytes();
  }
}

/// Reads each storage once and cuts all its tensors out of it.
TensorFile Materialize(const StoredTensors& tensors, const ReadStorage& read_storage) {
  std::map<std::string, std::vector<const StoredTensors::value_type*>> by_storage;
  for (const auto& named : tensors) by_storage[named.second.storage.key].push_back(&named);
  TensorFile file;
  for (const auto& [key, users] : by_storage) {
    std::vector<std::byte> storage = read_storage(users.front()->second.storage);
    for (const auto* const user : users) {
      const StoredTensor& tensor = user->second;
      HostTensor& result = file.tensors[user->first];
      result.dtype = tensor.storage.dtype;
      result.shape = tensor.shape;
      const bool is_last = user == users.back();
      result.data =
          is_last && IsWholeStorage(tensor) ? std::move(storage) : CopyView(tensor, storage);
    }
  }
  return file;
}

/// The folder inside the archive, with its '/', in which torch.save put everything.
std::optional<std::string> FindTorchFolder(const ZipArchive& archive) {
  constexpr std::string_view kPickleName = "data.pkl";
  for (const auto& [name, entry] : archive.entries()) {
    const std::string folder = name.substr(0, name.find('/') + 1);
    if (name == folder + std::string(kPickleName)) return folder;
  }
  return std::nullopt;
}

/// Where the tensors of a zip checkpoint are.
StoredTensors FindInZipCheckpoint(const InputFile& file, const ZipArchive& archive, const std::string& folder,
                                  const TensorFilter& is_wanted) {
  if (archive.entries().contains(folder + "constants.pkl")) {
    throw BadFile(file.subject(), "is a TorchScript program, not a checkpoint", kSaveStateDict);
  }
  const std::string byte_order = folder + "byteorder";
  if (archive.entries().contains(byte_order) && archive.ReadText(byte_order, 100) != "little") {
    throw BadFile(file.subject(), "was written on a big-endian machine",
                  "load and save it on a little-endian one");
  }
  const std::string bytes = archive.ReadText(folder + "data.pkl", kMaxPickleBytes);
  const Pickle pickle = ReadPickle(bytes, file.subject());
  StoredTensors tensors = Collector(file.subject(), is_wanted).Collect(*pickle.root);
  CheckTotalSize(tensors, file);
  return tensors;
}

std::vector<std::byte> ReadZipStorage(const std::string& subject, const ZipArchive& archive, const std::string& folder,
                                      const Storage& storage) {
  std::vector<std::byte> bytes = archive.Read(folder + "data/" + storage.key);
  if (bytes.size() < storage.bytes()) {
    throw BadFile(subject, "the storage " + Quoted(storage.key) + " is cut short", kDamaged);
  }
  bytes.resize(storage.bytes());
  return bytes;
}

TensorFile ReadZipCheckpoint(const InputFile& file, const ZipArchive& archive,
                             const std::string& folder, const TensorFilter& is_wanted) {
  return Materialize(FindInZipCheckpoint(file, archive, folder, is_wanted), [&](const Storage& storage) {
    return ReadZipStorage(file.subject(), archive, folder, storage);
  });
}

/// Takes one pickle after the other from the beginning of a legacy file.
class PickleSequence {
 public:
  explicit PickleSequence(const InputFile& file)
      : subject_(file.subject()),
        bytes_(file.ReadText(0, std::min<std::uint64_t>(file.size(), kMaxPickleBytes))) {}

  Pickle Next() {
    Pickle pickle = ReadPickle(std::string_view(bytes_).substr(position_), subject_);
    position_ += pickle.bytes_read;
    return pickle;
  }

  std::uint64_t position() const { return position_; }

 private:
  std::string subject_;
  std::string bytes_;
  std::size_t position_ = 0;
};

void CheckLegacyStart(const InputFile& file) {
  // The opcodes PROTO and LONG1 with their arguments come before the magic number.
  constexpr std::size_t kPrefix = 4;
  const std::size_t length = kPrefix + kLegacyMagic.size() + 1;
  const bool is_legacy =
      file.size() > length && file.ReadText(kPrefix, kLegacyMagic.size()) == kLegacyMagic;
  if (!is_legacy) {
    throw BadFile(file.subject(), "is not a PyTorch checkpoint",
                  "give a .pth, .pt or .ckpt file written by torch.save");
  }
}

void CheckLegacySystem(const InputFile& file, const PickleObject& information) {
  for (std::size_t i = 0; i + 1 < information.items.size(); i += 2) {
    const bool is_byte_order = information.items[i]->text == "little_endian";
    if (is_byte_order && information.items[i + 1]->integer == 0) {
      throw BadFile(file.subject(), "was written on a big-endian machine",
                    "load and save it on a little-endian one");
    }
  }
}

/// Where the numbers of each storage begin. In the file, each storage is an int64 count of elements
/// and then the elements; how large one element is, only the tensors say.
std::map<std::string, std::uint64_t> LocateLegacyStorages(
    const InputFile& file, const PickleObject& keys, const std::map<std::string, Storage>& storages,
    std::uint64_t position) {
  std::map<std::string, std::uint64_t> offsets;
  for (const PickleObject* const key : keys.items) {
    const auto storage = storages.find(std::string(key->text));
    if (storage == storages.end()) {
      throw BadFile(file.subject(),
                    "the storage " + Quoted(key->text) + " is of an unsupported kind",
                    kSaveStateDict);
    }
    std::uint64_t elements = 0;
    std::memcpy(&elements, file.Read(position, sizeof(elements)).data(), sizeof(elements));
    position += sizeof(elements);
    const std::uint64_t bytes = storage->second.bytes();
    if (elements != storage->second.elements || bytes > file.size() - position) {
      throw BadFile(file.subject(), "the storage " + Quoted(key->text) + " is cut short", kDamaged);
    }
    offsets[storage->first] = position;
    position += bytes;
  }
  return offsets;
}

/// Every storage an unpickled object refers to, wherever it is.
std::map<std::string, Storage> AllStorages(const Pickle& pickle) {
  std::map<std::string, Storage> storages;
  for (const PickleObject& object : pickle.objects) {
    if (object.kind != PickleKind::kPersistent || !IsStorageId(*object.items[0])) continue;
    const std::optional<Storage> storage = ParseStorage(*object.items[0]);
    if (storage) storages.emplace(storage->key, *storage);
  }
  return storages;
}

TensorFile ReadLegacyCheckpoint(const InputFile& file, const TensorFilter& is_wanted) {
  CheckLegacyStart(file);
  PickleSequence pickles(file);
  pickles.Next();
  const Pickle protocol = pickles.Next();
  if (protocol.root->integer != kLegacyProtocol) {
    throw BadFile(file.subject(), "has an unknown version of the legacy format", kSaveStateDict);
  }
  const Pickle system = pickles.Next();
  CheckLegacySystem(file, *system.root);
  const Pickle object = pickles.Next();
  const StoredTensors tensors = Collector(file.subject(), is_wanted).Collect(*object.root);
  CheckTotalSize(tensors, file);
  const Pickle keys = pickles.Next();
  const auto offsets =
      LocateLegacyStorages(file, *keys.root, AllStorages(object), pickles.position());
  return Materialize(tensors, [&](const Storage& storage) {
    const auto found = offsets.find(storage.key);
    if (found == offsets.end()) {
      throw BadFile(file.subject(), "lacks the storage " + Quoted(storage.key), kDamaged);
    }
    return file.Read(found->second, storage.bytes());
  });
}

bool IsZip(const InputFile& file) {
  return file.size() >= 4 && file.ReadText(0, 4) == std::string("PK\x03\x04");
}

/// The only checkpoint packed in an archive that is called `member`, or the only one at all if that
/// is empty.
/// @throws BadFile if there is none or several
std::string FindPackedCheckpoint(const InputFile& file, const ZipArchive& archive,
                                 const std::string& member) {
  std::vector<std::string> names;
  for (const auto& [name, entry] : archive.entries()) {
    const std::filesystem::path path(name);
    const std::filesystem::path extension = path.extension();
    const bool is_checkpoint = extension == ".pth" || extension == ".pt" || extension == ".ckpt";
    if (member.empty() ? is_checkpoint : path.filename() == member) names.push_back(name);
  }
  if (names.size() == 1) return names.front();
  const std::string kind = member.empty() ? "checkpoint" : Quoted(member);
  throw BadFile(file.subject(),
                names.empty() ? "contains no " + kind
                              : "contains " + std::to_string(names.size()) + " checkpoints" +
                                    (member.empty() ? "" : " " + kind),
                "give a .pth, .pt or .ckpt file, or an archive with exactly one");
}

TensorFile ReadCheckpoint(const InputFile& file, const TensorFilter& is_wanted) {
  if (!IsZip(file)) return ReadLegacyCheckpoint(file, is_wanted);
  const ZipArchive archive(file);
  const std::optional<std::string> folder = FindTorchFolder(archive);
  if (!folder) {
    throw BadFile(file.subject(), "is an archive without a checkpoint", kSaveStateDict);
  }
  return ReadZipCheckpoint(file, archive, *folder, is_wanted);
}

TensorFile ReadFileOrMember(const std::filesystem::path& path, const std::string& member,
                            const TensorFilter& is_wanted) {
  const InputFile file(path);
  if (!IsZip(file)) return ReadLegacyCheckpoint(file, is_wanted);
  const ZipArchive archive(file);
  const std::optional<std::string> folder = FindTorchFolder(archive);
  if (folder) return ReadZipCheckpoint(file, archive, *folder, is_wanted);
  const InputFile packed = archive.Extract(FindPackedCheckpoint(file, archive, member));
  return ReadCheckpoint(packed, is_wanted);
}

bool IsAnyTensor(const std::string&) { return true; }

}  // namespace

LazyTensorFile OpenPytorchCheckpoint(const std::filesystem::path& path) {
  const auto file = std::make_shared<const InputFile>(path);
  const auto archive = IsZip(*file) ? std::make_shared<const ZipArchive>(*file) : nullptr;
  const std::optional<std::string> folder = archive ? FindTorchFolder(*archive) : std::nullopt;
  if (!folder) return LazyCopyOf(ReadPytorchCheckpoint(path));
  LazyTensorFile lazy;
  for (const auto& [name, tensor] : FindInZipCheckpoint(*file, *archive, *folder, IsAnyTensor)) {
    const auto read = [file, archive, folder = *folder, tensor = tensor] {
      const std::vector<std::byte> storage = ReadZipStorage(file->subject(), *archive, folder, tensor.storage);
      return HostTensor{tensor.storage.dtype, tensor.shape, CopyView(tensor, storage)};
    };
    lazy.tensors[name] = {tensor.storage.dtype, tensor.shape, read};
  }
  return lazy;
}

TensorFile ReadPytorchCheckpoint(const std::filesystem::path& path) {
  return ReadFileOrMember(path, "", IsAnyTensor);
}

TensorFile ReadPytorchCheckpoint(const std::filesystem::path& path, const TensorFilter& is_wanted) {
  return ReadFileOrMember(path, "", is_wanted);
}

TensorFile ReadPytorchCheckpoint(const std::filesystem::path& path, const std::string& member) {
  return ReadFileOrMember(path, member, IsAnyTensor);
}

}  // namespace antipode
