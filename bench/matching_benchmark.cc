// Matches image pairs as it is told, for bench/matching_peer.py: matching_benchmark MATCHER THREADS
// Each line of the input, "REFERENCE QUERY", is answered by one line of JSON: milliseconds and
// matches.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <string>

#include <torch/torch.h>
#include <nlohmann/json.hpp>

#include "antipode/image/load.h"
#include "antipode/matching/matchers.h"
#include "guarded_main.h"

namespace antipode {
namespace {

nlohmann::json Rows(const Correspondences& found) {
  auto rows = nlohmann::json::array();
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto &a = found.reference[i], &b = found.query[i];
    rows.push_back({a.x(), a.y(), b.x(), b.y(), found.scores[i]});
  }
  return rows;
}

void Answer(const Matcher& matcher, const std::string& reference_file,
            const std::string& query_file) {
  const cv::Mat reference = LoadImage(reference_file).rgb, query = LoadImage(query_file).rgb;
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t processor_begin = std::clock();
  const Correspondences found = matcher.Match(reference, query);
  const double processor =
      1000.0 * static_cast<double>(std::clock() - processor_begin) / CLOCKS_PER_SEC;
  const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - begin;
  const nlohmann::json answer = {
      {"milliseconds", spent.count()}, {"processor", processor}, {"matches", Rows(found)}};
  std::cout << answer << std::endl;
}

int Run(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: matching_benchmark MATCHER THREADS\n");
    return 2;
  }
  at::set_num_threads(std::atoi(argv[2]));
  cv::setNumThreads(std::atoi(argv[2]));
  const auto matcher = MakeMatcher(argv[1]);
  std::string reference, query;
  while (std::cin >> reference >> query) Answer(*matcher, reference, query);
  return 0;
}

}  // namespace
}  // namespace antipode

int main(int argc, char** argv) { return antipode::GuardedMain("matching_benchmark", antipode::Run, argc, argv); }
