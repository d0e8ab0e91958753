#pragma once

#include <vector>

#include "catalogue.h"

namespace antipode::golden {

/// The selector and the refiner, their losses and the geometry around them.
std::vector<CatalogueEntry> Gen6dKinds();

}  // namespace antipode::golden
