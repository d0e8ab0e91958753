#pragma once

#include <vector>

#include "catalogue.h"

namespace antipode::golden {

/// Elevation and in-plane rotation of a picture.
std::vector<CatalogueEntry> OrientationKinds();

}  // namespace antipode::golden
