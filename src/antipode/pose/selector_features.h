#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "antipode/gen6d/selector.h"

namespace antipode {

/// A selector's features of a reference's views are kept beside them, so that many queries need them computed once. At
/// most 60 MB: the built-in selector's of 64 views are 29, VGG-11's 220 and not kept.

/// @param selector_sha256 of its model
/// @return nothing if there are none of this selector and this reference, or if they are damaged
std::optional<SelectorFeatures> ReadSelectorFeatures(const std::filesystem::path& reference_folder, const std::string& selector_sha256);

/// @throws Error if the folder cannot be written
void KeepSelectorFeatures(const std::filesystem::path& reference_folder, const std::string& selector_sha256, const SelectorFeatures& features);

}  // namespace antipode
