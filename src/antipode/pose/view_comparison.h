#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "antipode/gen6d/view_set.h"
#include "antipode/pose/reference.h"

namespace antipode {

/// Gen6D's networks, each optional, and how they are used.
class ViewComparison {
 public:
  /// @param selector, refiner names of models or folders; empty: without
  static ViewComparison Load(const std::string& selector, const std::string& refiner, torch::Device device = torch::kCPU);
  ViewComparison(std::optional<Selector> selector, std::optional<Refiner> refiner)
      : selector_(std::move(selector)), refiner_(std::move(refiner)) {}

  bool Selects() const { return selector_.has_value(); }
  bool Refines() const { return refiner_.has_value(); }

  /// Computes the features of a reference's views; once for many queries.
  /// @param folder of the reference, if it has one: there a loaded selector's features are read, or kept for the next time
  /// @return warnings
  std::vector<std::string> Prepare(const Reference& reference, const std::filesystem::path& folder = {},
                                   const ProgressCallback& progress = {});

  /// The likeliest views with the poses they give, in the frame of the crop's camera.
  /// @param crop of the query, at any resolution
  struct Selection {
    Rigid3 crop_from_object;
    double probability = 0;  ///< softmax of the logits
  };
  std::vector<Selection> Select(const ObjectView& crop, std::size_t count);

  /// The poses after 0, 1, .. `iterations` steps, all starts in one batch.
  std::vector<std::vector<Rigid3>> Refine(const ObjectView& crop, const std::vector<Rigid3>& crop_from_object, int iterations);

 private:
  std::optional<Selector> selector_;
  std::optional<Refiner> refiner_;
  std::string selector_sha256_;  ///< of a loaded one
  std::vector<PosedPicture> pictures_;
  SelectorReferences references_;
};

}  // namespace antipode
