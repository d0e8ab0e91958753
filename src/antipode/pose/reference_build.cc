#include "antipode/pose/reference_build.h"

#include <string>
#include <vector>

#include "antipode/synthesis/view_folder.h"
#include "antipode/util/files.h"

namespace antipode {
namespace {

/// Of all that decides the reference.
std::string FingerprintOf(const ViewSynthesizer& synthesizer, std::span<const ViewRequest> requests, const PriorIdentity& prior,
                          const std::optional<Rigid3>& source) {
  std::string text = synthesizer.Fingerprint() + prior.sha256;
  for (const ViewRequest& request : requests) text += " " + request.name;
  if (source) {
    const Eigen::Matrix<double, 3, 4> pose = source->Matrix();
    text += Sha256Hex(std::as_bytes(std::span(pose.data(), 12)));
  }
  return Sha256Hex(std::as_bytes(std::span(text)));
}

}  // namespace

Reference BuildReference(const ViewSynthesizer& synthesizer, std::span<const ViewRequest> requests, const ObjectPrior& prior,
                         const PriorIdentity& prior_identity, const std::optional<Rigid3>& source_from_object,
                         const std::filesystem::path& folder, const ProgressCallback& progress) {
  if (folder.empty()) {
    std::vector<SynthesizedView> views;
    synthesizer.Synthesize(requests, [&](const SynthesizedView& view) { views.push_back(view); }, progress);
    return MakeReference(std::move(views), prior, source_from_object, progress);
  }
  ViewFolder files(folder, synthesizer.Fingerprint());
  const std::vector<SynthesizedView> views = FindOrMakeViews(synthesizer, requests, files, progress);
  Reference reference = MakeReference(views, prior, source_from_object, progress);
  files.WriteOverviews(views);
  SaveReference(folder, reference, prior_identity, FingerprintOf(synthesizer, requests, prior_identity, source_from_object));
  return reference;
}

}  // namespace antipode
