#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>

#include <torch/torch.h>

#include "antipode/prior/object_prior.h"
#include "antipode/zero123/view_diffusion.h"

namespace antipode {

/// The object prior as guide of a small diffusion model: what the cameras of the views would see of the picture's code
/// (CodeMaps). A model remembers whose codes it was trained with; those of another prior mean nothing to it.
class ViewGuide {
 public:
  /// @param prior by name or folder
  explicit ViewGuide(const std::string& prior, torch::Device device = torch::kCPU);

  /// The guide of a trained model, or nothing if it has none.
  /// @param source the model, for messages. @throws BadFile if the installed prior is another one
  static std::optional<ViewGuide> Of(const std::map<std::string, std::string>& metadata, const std::string& source,
                                     torch::Device device = torch::kCPU);
  std::map<std::string, std::string> ToMetadata() const;

  int Channels() const;  ///< of its maps; evaluates the network once
  int PictureSize() const { return prior_.ViewOptions().size; }

  /// @param pictures [P, 3, S, S], 0..1, of PictureSize()
  torch::Tensor Encode(const torch::Tensor& pictures) const { return prior_.EncodeImages(pictures); }

  /// @param codes of Encode, one for each view or one for all
  /// @return [P, Channels(), size, size], on the CPU
  torch::Tensor Maps(const torch::Tensor& codes, std::span<const ViewCondition> views, int size) const;

 private:
  std::string name_, sha256_;
  ObjectPrior prior_;
};

}  // namespace antipode
