#pragma once

#include <string>

#include "antipode/image/draw.h"

namespace antipode {

/// What a confidence (0..1: how often the rotation is within 30 degrees) means, in words: "very
/// likely right" from 0.85, "probably right" from 0.6, "uncertain" from 0.35, else "probably wrong".
std::string ConfidenceWords(double confidence);

/// Green, amber, orange, red at the same limits.
Colour ConfidenceColour(double confidence);

}  // namespace antipode
