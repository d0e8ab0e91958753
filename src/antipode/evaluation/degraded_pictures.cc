#include "antipode/evaluation/degraded_pictures.h"

#include <algorithm>
#include <random>
#include <utility>

#include "antipode/image/degradation.h"
#include "antipode/util/error.h"
#include "antipode/util/seeds.h"

namespace antipode {
namespace {

constexpr double kBlurLength = 0.02;    // of the shorter side
constexpr double kNoiseDeviation = 15;  // of 255
constexpr int kJpegQuality = 15;
constexpr double kCutShare = 0.2;

void Degrade(ObjectPhotograph& photograph, Degradation degradation, std::mt19937_64& random) {
  const int side = std::min(photograph.image.cols, photograph.image.rows);
  switch (degradation) {
    case Degradation::kMotionBlur:
      photograph.image = MotionBlurred(photograph.image, kBlurLength * side, UniformIn(random, 0, 180));
      return;
    case Degradation::kNoise: photograph.image = WithNoise(photograph.image, kNoiseDeviation, random()); return;
    case Degradation::kJpeg: photograph.image = AfterJpeg(photograph.image, kJpegQuality); return;
    case Degradation::kCutOff:
      photograph.mask = CutOff(photograph.mask, static_cast<PictureSide>(UniformIndex(random, 4)), kCutShare);
      return;
  }
}

}  // namespace

Degradation DegradationNamed(const std::string& name) {
  if (name == "motion-blur") return Degradation::kMotionBlur;
  if (name == "noise") return Degradation::kNoise;
  if (name == "jpeg") return Degradation::kJpeg;
  if (name == "cut-off") return Degradation::kCutOff;
  throw InvalidOption("degrade", "is " + name, "use motion-blur, noise, jpeg or cut-off");
}

DegradedPictures::DegradedPictures(std::unique_ptr<Dataset> dataset, Degradation degradation)
    : AlteredPhotographs(std::move(dataset), [degradation](ObjectPhotograph& photograph, std::mt19937_64& random) {
        Degrade(photograph, degradation, random);
      }) {}

}  // namespace antipode
