#pragma once

#include <stdexcept>
#include <string>

namespace antipode {

/// Any failure the user can act on. `what()` is one line: "<subject>: <problem>; <remedy>".
class Error : public std::runtime_error {
 public:
  /// @param subject the file, option field or pipeline stage at fault
  /// @param problem what is wrong with it
  /// @param remedy  what to do about it; may be empty
  Error(const std::string& subject, const std::string& problem, const std::string& remedy = {});
};

/// A file that cannot be read, understood or trusted.
class BadFile : public Error {
 public:
  using Error::Error;
};

/// An option with an impossible value; the subject is the field's name.
class InvalidOption : public Error {
 public:
  using Error::Error;
};

/// The work was stopped on request (Ctrl-C).
class Interrupted : public Error {
 public:
  using Error::Error;
};

}  // namespace antipode
