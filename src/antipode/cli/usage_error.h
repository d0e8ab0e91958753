#pragma once

#include "antipode/util/error.h"

namespace antipode {

/// A command line that cannot be understood.
class UsageError : public Error {
 public:
  using Error::Error;
};

}  // namespace antipode
