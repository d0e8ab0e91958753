#pragma once

#include <vector>

#include "catalogue.h"

namespace antipode::golden {

/// Metrics, predefined views, look-at cameras and pose composition.
std::vector<CatalogueEntry> GeometryKinds();

}  // namespace antipode::golden
