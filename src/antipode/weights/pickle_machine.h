#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace antipode {

enum class PickleKind {
  kNone,
  kBool,        ///< `integer` is 0 or 1
  kInteger,     ///< `integer`
  kBigInteger,  ///< `text`: more than 8 bytes, little-endian two's complement
  kReal,        ///< `real`
  kText,        ///< `text`
  kBytes,       ///< `text`
  kTuple,       ///< `items`
  kList,        ///< `items`
  kSet,         ///< `items`
  kDict,        ///< `items`: key, value, key, value...; of equal keys the last one counts
  kGlobal,      ///< `text`: "module.name"; only a name, nothing is looked up
  kCall,        ///< `items`: callable, arguments; only noted, never made
  kPersistent,  ///< `items`: the persistent id
};

struct PickleObject {
  PickleKind kind = PickleKind::kNone;
  std::int64_t integer = 0;
  double real = 0;
  std::string_view text;
  std::vector<const PickleObject*> items;
};

/// What a pickle describes, as plain data. Objects may be shared and may contain themselves.
/// Texts point into the bytes it was read from.
struct Pickle {
  const PickleObject* root = nullptr;
  std::size_t bytes_read = 0;
  std::deque<PickleObject> objects;
  std::deque<std::string> global_names;
};

/// Reads one pickle (protocols 2 to 4) from the start of `bytes` without executing anything. Calls
/// become `kCall`, but for `collections.OrderedDict`, which becomes a `kDict`. What is set on an
/// object after its making (BUILD, items added to a call) is dropped.
/// @param subject names the file in errors
/// @throws BadFile for damaged pickles, opcodes a checkpoint does not need, more than 4 million
///         objects or a million values on the stack, and, by name, for globals that execute code
Pickle ReadPickle(std::string_view bytes, const std::string& subject);

}  // namespace antipode
