#include "antipode/util/quote.h"

namespace antipode {

std::string Quoted(std::string_view text) {
  constexpr std::size_t kMaxLength = 120;
  std::string quoted = "'";
  for (const char c : text.substr(0, kMaxLength)) quoted += c >= 0x20 && c < 0x7f ? c : '?';
  if (text.size() > kMaxLength) quoted += "...";
  return quoted + "'";
}

}  // namespace antipode
