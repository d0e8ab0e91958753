#pragma once

#include <vector>

#include "catalogue.h"

namespace antipode::golden {

/// The diffusion model: its layers and networks, schedules, sampling, and the preparation of pictures.
std::vector<CatalogueEntry> Zero123Kinds();

}  // namespace antipode::golden
