#pragma once

#include <memory>
#include <string>

#include "antipode/evaluation/altered_photographs.h"

namespace antipode {

/// How a data set's pictures are made worse; lengths are of the picture's shorter side.
enum class Degradation {
  kMotionBlur,  ///< along 2 percent, in any direction
  kNoise,       ///< of deviation 0.06 of white
  kJpeg,        ///< of quality 15
  kCutOff,      ///< a fifth of the object's box, on any side, is beyond the picture's border
};

/// @param name motion-blur, noise, jpeg or cut-off @throws InvalidOption
Degradation DegradationNamed(const std::string& name);

/// A data set of photographs as they really are.
class DegradedPictures : public AlteredPhotographs {
 public:
  DegradedPictures(std::unique_ptr<Dataset> dataset, Degradation degradation);
};

}  // namespace antipode
