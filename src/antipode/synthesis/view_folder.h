#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "antipode/synthesis/view_synthesizer.h"

namespace antipode {

/// A folder with synthesised views: NAME.png each and `views.json`, which lists them with their cameras and the sha256 of
/// the files. Only views of the same picture, model and settings are kept when work goes on in the folder.
class ViewFolder {
 public:
  /// @param fingerprint of all that decides the views but the view itself
  /// @throws BadFile if views.json is damaged; Error if the folder holds views of other settings
  ViewFolder(const std::filesystem::path& folder, const std::string& fingerprint);

  /// The view if it is there and its file is what was written.
  std::optional<SynthesizedView> Find(const ViewRequest& request) const;

  /// All views of a finished folder, whatever made them.
  /// @throws BadFile naming what is missing or not as it was written
  static std::vector<SynthesizedView> LoadAll(const std::filesystem::path& folder);

  /// Writes the picture, then the list. @throws Error if it cannot be written
  void Add(const SynthesizedView& view);

  /// `contact_sheet.png`, `transforms.json` (NeRF tools: OpenGL camera axes, +Z up) and `colmap/cameras.txt`,
  /// `images.txt` and `points3D.txt`.
  void WriteOverviews(const std::vector<SynthesizedView>& views) const;

 private:
  struct Entry {
    std::string name, sha256, json;
  };
  /// What the folder holds, whatever made it.
  explicit ViewFolder(std::filesystem::path folder);
  bool IsIntact(const Entry& entry) const;
  SynthesizedView Read(const Entry& entry) const;
  void WriteList() const;

  std::filesystem::path folder_;
  std::string fingerprint_;
  std::vector<Entry> entries_;
};

/// All pictures side by side, in rows.
cv::Mat ContactSheet(const std::vector<SynthesizedView>& views);

/// The views of the requests, in their order: those that the folder has, and the others made and added.
std::vector<SynthesizedView> FindOrMakeViews(const ViewSynthesizer& synthesizer, std::span<const ViewRequest> requests,
                                             ViewFolder& folder, const ProgressCallback& progress = {});

}  // namespace antipode
