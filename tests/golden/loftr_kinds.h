#pragma once

#include <vector>

#include "catalogue.h"

namespace antipode::golden {

/// LoFTR on two images, and its position code.
std::vector<CatalogueEntry> LoftrKinds();

}  // namespace antipode::golden
