#pragma once

#include <string>
#include <vector>

namespace antipode {

/// The processor's name as the system tells it, or "unknown".
std::string ProcessorName();

/// Which of AVX2, FMA, AVX-512, AVX-512 BF16, AMX the processor and the system offer.
std::vector<std::string> ProcessorFeatures();

}  // namespace antipode
