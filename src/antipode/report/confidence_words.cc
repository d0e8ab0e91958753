#include "antipode/report/confidence_words.h"

namespace antipode {
namespace {

struct Grade {
  double least_confidence;
  const char* words;
  Colour colour;
};

const Grade& GradeOf(double confidence) {
  static const Grade kGrades[] = {{0.85, "very likely right", {44, 160, 44}},
                                  {0.6, "probably right", {150, 175, 30}},
                                  {0.35, "uncertain", {240, 150, 20}},
                                  {0, "probably wrong", {214, 39, 40}}};
  for (const Grade& grade : kGrades)
    if (confidence >= grade.least_confidence) return grade;
  return kGrades[3];
}

}  // namespace

std::string ConfidenceWords(double confidence) { return GradeOf(confidence).words; }

Colour ConfidenceColour(double confidence) { return GradeOf(confidence).colour; }

}  // namespace antipode
