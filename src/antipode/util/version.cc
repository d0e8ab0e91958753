#include "antipode/util/version.h"

namespace antipode {

const char* Version() { return ANTIPODE_VERSION; }

}  // namespace antipode
