#include "antipode/weights/pickle_machine.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <unordered_map>
#include <utility>

#include "antipode/util/error.h"
#include "antipode/util/quote.h"

namespace antipode {
namespace {

constexpr std::size_t kMaxObjects = 4'000'000;
constexpr std::size_t kMaxStack = 1'000'000;
constexpr std::size_t kMaxGlobalName = 1000;
constexpr int kMaxProtocol = 4;
constexpr std::string_view kOrderedDict = "collections.OrderedDict";

enum class Opcode : unsigned char {
  kMark = '(',
  kStop = '.',
  kPop = '0',
  kPopMark = '1',
  kDup = '2',
  kBinFloat = 'G',
  kBinInt = 'J',
  kBinInt1 = 'K',
  kBinInt2 = 'M',
  kNone = 'N',
  kBinPersid = 'Q',
  kReduce = 'R',
  kBinString = 'T',
  kShortBinString = 'U',
  kBinUnicode = 'X',
  kAppend = 'a',
  kBuild = 'b',
  kGlobal = 'c',
  kAppends = 'e',
  kBinGet = 'h',
  kLongBinGet = 'j',
  kBinPut = 'q',
  kLongBinPut = 'r',
  kSetItem = 's',
  kTuple = 't',
  kSetItems = 'u',
  kEmptyDict = '}',
  kEmptyList = ']',
  kEmptyTuple = ')',
  kBinBytes = 'B',
  kShortBinBytes = 'C',
  kProto = 0x80,
  kNewObj = 0x81,
  kTuple1 = 0x85,
  kTuple2 = 0x86,
  kTuple3 = 0x87,
  kNewTrue = 0x88,
  kNewFalse = 0x89,
  kLong1 = 0x8a,
  kLong4 = 0x8b,
  kShortBinUnicode = 0x8c,
  kBinUnicode8 = 0x8d,
  kBinBytes8 = 0x8e,
  kEmptySet = 0x8f,
  kAddItems = 0x90,
  kFrozenSet = 0x91,
  kNewObjEx = 0x92,
  kStackGlobal = 0x93,
  kMemoize = 0x94,
  kFrame = 0x95,
};

/// Top-level modules whose functions run code, touch the system, or hide further pickles.
constexpr auto kForbiddenModules =
    std::to_array<std::string_view>({"os",         "posix",     "nt",
                                     "subprocess", "sys",       "shutil",
                                     "socket",     "importlib", "imp",
                                     "runpy",      "pty",       "commands",
                                     "ctypes",     "_ctypes",   "code",
                                     "codeop",     "pickle",    "_pickle",
                                     "cPickle",    "dill",      "cloudpickle",
                                     "joblib",     "marshal",   "types",
                                     "webbrowser", "asyncio",   "signal",
                                     "threading",  "_thread",   "tempfile",
                                     "timeit",     "cProfile",  "profile",
                                     "pdb",        "bdb",       "trace",
                                     "operator",   "_operator", "urllib",
                                     "http",       "requests",  "ftplib",
                                     "smtplib",    "pip",       "pkgutil",
                                     "zipimport",  "sqlite3",   "atexit",
                                     "gc",         "inspect",   "multiprocessing",
                                     "concurrent", "io",        "_io",
                                     "ssl",        "venv"});

constexpr auto kForbiddenPrefixes = std::to_array<std::string_view>(
    {"torch.load", "torch.hub.", "torch.jit.", "torch.package.", "torch.serialization.load",
     "torch.serialization._load", "torch.serialization._legacy_load",
     "torch.storage._load_from_bytes", "torch.utils.cpp_extension.", "torch.utils.model_zoo.",
     "numpy.load", "numpy.testing.", "numpy.distutils.", "numpy.f2py."});

/// All that is harmless in `builtins`; everything else there can be made to run code.
constexpr auto kHarmlessBuiltins = std::to_array<std::string_view>(
    {"set", "frozenset", "dict", "list", "tuple", "int", "long", "float", "bool", "str", "unicode",
     "bytes", "bytearray", "complex", "slice", "range", "xrange", "object", "type"});

template <typename Names>
bool Contains(const Names& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool IsForbidden(std::string_view module, std::string_view name) {
  const std::string_view top_module = module.substr(0, module.find('.'));
  if (top_module == "builtins" || top_module == "__builtin__") {
    return module != top_module || !Contains(kHarmlessBuiltins, name);
  }
  if (Contains(kForbiddenModules, top_module)) return true;
  const std::string full = std::string(module) + "." + std::string(name);
  return std::any_of(kForbiddenPrefixes.begin(), kForbiddenPrefixes.end(),
                     [&](std::string_view prefix) { return full.starts_with(prefix); });
}

class Machine {
 public:
  Machine(std::string_view bytes, const std::string& subject) : bytes_(bytes), subject_(subject) {}

  Pickle Run() {
    while (true) {
      const auto opcode = static_cast<Opcode>(ReadUnsigned(1));
      if (opcode == Opcode::kStop) break;
      Execute(opcode);
    }
    pickle_.root = Pop();
    pickle_.bytes_read = position_;
    return std::move(pickle_);
  }

 private:
  using Items = std::vector<const PickleObject*>;

  [[noreturn]] void Fail(const std::string& problem) const {
    throw BadFile(subject_, "the pickle " + problem + " at byte " + std::to_string(position_),
                  "the file is damaged or no checkpoint; nothing in it was executed");
  }

  void Execute(Opcode opcode) {
    switch (opcode) {
      case Opcode::kProto:
        return CheckProtocol();
      case Opcode::kFrame:
        ReadUnsigned(8);
        return;
      case Opcode::kMark:
        return PushMark();
      case Opcode::kPop:
        return PopValueOrMark();
      case Opcode::kPopMark:
        PopToMark();
        return;
      case Opcode::kDup:
        return Push(Top());

      case Opcode::kNone:
        return PushNew(PickleKind::kNone);
      case Opcode::kNewTrue:
        return PushInteger(PickleKind::kBool, 1);
      case Opcode::kNewFalse:
        return PushInteger(PickleKind::kBool, 0);
      case Opcode::kBinInt:
        return PushInteger(PickleKind::kInteger, static_cast<std::int32_t>(ReadUnsigned(4)));
      case Opcode::kBinInt1:
        return PushInteger(PickleKind::kInteger, ReadUnsigned(1));
      case Opcode::kBinInt2:
        return PushInteger(PickleKind::kInteger, ReadUnsigned(2));
      case Opcode::kLong1:
        return PushLong(ReadUnsigned(1));
      case Opcode::kLong4:
        return PushLong(ReadUnsigned(4));
      case Opcode::kBinFloat:
        return PushReal();
      case Opcode::kBinString:
      case Opcode::kBinUnicode:
        return PushText(PickleKind::kText, ReadUnsigned(4));
      case Opcode::kShortBinString:
      case Opcode::kShortBinUnicode:
        return PushText(PickleKind::kText, ReadUnsigned(1));
      case Opcode::kBinUnicode8:
        return PushText(PickleKind::kText, ReadUnsigned(8));
      case Opcode::kBinBytes:
        return PushText(PickleKind::kBytes, ReadUnsigned(4));
      case Opcode::kShortBinBytes:
        return PushText(PickleKind::kBytes, ReadUnsigned(1));
      case Opcode::kBinBytes8:
        return PushText(PickleKind::kBytes, ReadUnsigned(8));

      case Opcode::kEmptyTuple:
        return PushNew(PickleKind::kTuple);
      case Opcode::kTuple1:
        return PushItems(PickleKind::kTuple, PopMany(1));
      case Opcode::kTuple2:
        return PushItems(PickleKind::kTuple, PopMany(2));
      case Opcode::kTuple3:
        return PushItems(PickleKind::kTuple, PopMany(3));
      case Opcode::kTuple:
        return PushItems(PickleKind::kTuple, PopToMark());
      case Opcode::kFrozenSet:
        return PushItems(PickleKind::kSet, PopToMark());
      case Opcode::kEmptyList:
        return PushNew(PickleKind::kList);
      case Opcode::kEmptyDict:
        return PushNew(PickleKind::kDict);
      case Opcode::kEmptySet:
        return PushNew(PickleKind::kSet);
      case Opcode::kAppend:
        return AddTo(PickleKind::kList, PopMany(1));
      case Opcode::kAppends:
        return AddTo(PickleKind::kList, PopToMark());
      case Opcode::kAddItems:
        return AddTo(PickleKind::kSet, PopToMark());
      case Opcode::kSetItem:
        return AddTo(PickleKind::kDict, PopMany(2));
      case Opcode::kSetItems:
        return AddTo(PickleKind::kDict, PopToMark());

      case Opcode::kGlobal:
        return ReadGlobal();
      case Opcode::kStackGlobal:
        return PopGlobal();
      case Opcode::kReduce:
      case Opcode::kNewObj:
        return Call(PopMany(2));
      case Opcode::kNewObjEx:
        return Call(PopMany(3));
      case Opcode::kBuild:
        return DropState();
      case Opcode::kBinPersid:
        return PushItems(PickleKind::kPersistent, PopMany(1));

      case Opcode::kBinPut:
        return Memoize(ReadUnsigned(1));
      case Opcode::kLongBinPut:
        return Memoize(ReadUnsigned(4));
      case Opcode::kMemoize:
        return Memoize(memo_.size());
      case Opcode::kBinGet:
        return Push(Recall(ReadUnsigned(1)));
      case Opcode::kLongBinGet:
        return Push(Recall(ReadUnsigned(4)));
      case Opcode::kStop:
        break;
    }
    Fail("has the opcode " + std::to_string(static_cast<int>(opcode)) +
         ", which no checkpoint needs,");
  }

  std::string_view ReadBytes(std::uint64_t count) {
    if (count > bytes_.size() - position_) Fail("ends too early");
    const std::string_view read = bytes_.substr(position_, count);
    position_ += count;
    return read;
  }

  std::string_view ReadLine() {
    const std::size_t end = bytes_.substr(position_, kMaxGlobalName).find('\n');
    if (end == std::string_view::npos) Fail("has a global name without an end");
    const std::string_view line = ReadBytes(end);
    ReadBytes(1);
    return line;
  }

  std::uint64_t ReadUnsigned(std::size_t count) {
    std::uint64_t value = 0;
    const std::string_view read = ReadBytes(count);
    std::memcpy(&value, read.data(), count);
    return value;
  }

  void CheckProtocol() {
    const std::uint64_t protocol = ReadUnsigned(1);
    if (protocol > kMaxProtocol) Fail("has the protocol " + std::to_string(protocol));
  }

  void Push(const PickleObject* object) {
    if (stack_.size() == kMaxStack) Fail("puts too much on its stack");
    stack_.push_back(object);
  }

  PickleObject& New(PickleKind kind) {
    if (pickle_.objects.size() == kMaxObjects) Fail("has too many objects");
    PickleObject& object = pickle_.objects.emplace_back();
    object.kind = kind;
    return object;
  }

  void PushNew(PickleKind kind) { Push(&New(kind)); }

  void PushInteger(PickleKind kind, std::int64_t value) {
    PickleObject& object = New(kind);
    object.integer = value;
    Push(&object);
  }

  /// Little-endian two's complement of any length.
  void PushLong(std::uint64_t byte_count) {
    const std::string_view read = ReadBytes(byte_count);
    if (read.size() > sizeof(std::int64_t)) {
      PickleObject& object = New(PickleKind::kBigInteger);
      object.text = read;
      return Push(&object);
    }
    const bool is_negative = !read.empty() && (read.back() & 0x80) != 0;
    std::int64_t value = is_negative ? -1 : 0;
    std::memcpy(&value, read.data(), read.size());
    PushInteger(PickleKind::kInteger, value);
  }

  void PushReal() {
    std::string big_endian(ReadBytes(sizeof(double)));
    std::reverse(big_endian.begin(), big_endian.end());
    PickleObject& object = New(PickleKind::kReal);
    std::memcpy(&object.real, big_endian.data(), sizeof(double));
    Push(&object);
  }

  void PushText(PickleKind kind, std::uint64_t length) {
    PickleObject& object = New(kind);
    object.text = ReadBytes(length);
    Push(&object);
  }

  void PushItems(PickleKind kind, Items items) {
    PickleObject& object = New(kind);
    object.items = std::move(items);
    Push(&object);
  }

  void PushMark() {
    if (marks_.size() == kMaxStack) Fail("puts too much on its stack");
    marks_.push_back(stack_.size());
  }

  /// Values above the last mark are all that an opcode may take.
  std::size_t Available() const { return stack_.size() - (marks_.empty() ? 0 : marks_.back()); }

  const PickleObject* Top() const {
    if (Available() == 0) Fail("takes more from its stack than is there");
    return stack_.back();
  }

  const PickleObject* Pop() {
    const PickleObject* const top = Top();
    stack_.pop_back();
    return top;
  }

  void PopValueOrMark() {
    if (Available() == 0 && !marks_.empty()) return marks_.pop_back();
    Pop();
  }

  Items PopMany(std::size_t count) {
    if (Available() < count) Fail("takes more from its stack than is there");
    const Items items(stack_.end() - static_cast<std::ptrdiff_t>(count), stack_.end());
    stack_.resize(stack_.size() - count);
    return items;
  }

  Items PopToMark() {
    if (marks_.empty()) Fail("lacks a mark");
    Items items = PopMany(Available());
    marks_.pop_back();
    return items;
  }

  /// Adds to the collection on top of the stack. Every object is owned, and first made, in
  /// `pickle_`.
  void AddTo(PickleKind kind, const Items& items) {
    PickleObject& target = const_cast<PickleObject&>(*Top());
    if (kind == PickleKind::kDict && items.size() % 2 != 0) Fail("has a key without a value");
    if (target.kind == PickleKind::kCall) return;
    if (target.kind != kind) Fail("adds items to what cannot hold them");
    target.items.insert(target.items.end(), items.begin(), items.end());
  }

  void ReadGlobal() {
    const std::string_view module = ReadLine();
    const std::string_view name = ReadLine();
    PushGlobal(module, name);
  }

  void PopGlobal() {
    const Items names = PopMany(2);
    if (names[0]->kind != PickleKind::kText || names[1]->kind != PickleKind::kText) {
      Fail("names a global by something else than texts");
    }
    PushGlobal(names[0]->text, names[1]->text);
  }

  void PushGlobal(std::string_view module, std::string_view name) {
    if (module.size() + name.size() > 2 * kMaxGlobalName) Fail("has a global with too long a name");
    std::string full = std::string(module) + "." + std::string(name);
    if (IsForbidden(module, name)) {
      throw BadFile(subject_,
                    "asks for the forbidden global " + Quoted(full) + "; nothing was executed",
                    "do not trust this file; get the weights from another place");
    }
    PickleObject& object = New(PickleKind::kGlobal);
    object.text = pickle_.global_names.emplace_back(std::move(full));
    Push(&object);
  }

  void Call(const Items& callable_and_arguments) {
    const PickleObject& callable = *callable_and_arguments[0];
    const PickleObject& arguments = *callable_and_arguments[1];
    if (callable.kind != PickleKind::kGlobal && callable.kind != PickleKind::kCall) {
      Fail("calls what is not callable");
    }
    if (arguments.kind != PickleKind::kTuple) Fail("calls without a tuple of arguments");
    if (callable.kind == PickleKind::kGlobal && callable.text == kOrderedDict) {
      return PushOrderedDict(arguments);
    }
    PushItems(PickleKind::kCall, callable_and_arguments);
  }

  /// Python 2 passes the pairs as an argument, Python 3 sets them afterwards.
  void PushOrderedDict(const PickleObject& arguments) {
    PickleObject& dict = New(PickleKind::kDict);
    Push(&dict);
    if (arguments.items.empty()) return;
    const Items& pairs = arguments.items[0]->items;
    // The same list can be passed again and again, so its size alone limits nothing.
    copied_pairs_ += pairs.size();
    if (copied_pairs_ > kMaxObjects) Fail("has too many objects");
    for (const PickleObject* const pair : pairs) {
      if (pair->items.size() != 2) Fail("has an OrderedDict of something else than pairs");
      dict.items.insert(dict.items.end(), pair->items.begin(), pair->items.end());
    }
  }

  void DropState() {
    Pop();
    Top();
  }

  void Memoize(std::uint64_t index) { memo_[index] = Top(); }

  const PickleObject* Recall(std::uint64_t index) const {
    const auto found = memo_.find(index);
    if (found == memo_.end()) Fail("recalls what was never stored");
    return found->second;
  }

  std::string_view bytes_;
  const std::string& subject_;
  std::size_t position_ = 0;
  Items stack_;
  std::vector<std::size_t> marks_;
  std::unordered_map<std::uint64_t, const PickleObject*> memo_;
  std::size_t copied_pairs_ = 0;
  Pickle pickle_;
};

}  // namespace

Pickle ReadPickle(std::string_view bytes, const std::string& subject) {
  return Machine(bytes, subject).Run();
}

}  // namespace antipode
