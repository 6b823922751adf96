// A stack that reports what it read, and fails in each way that a process can.
#include <cstdio>
#include <stdexcept>
#include <string>

#include "wayproof.hpp"

class Probe : public wayproof::Stack {
 public:
  explicit Probe(std::string mode) : mode_(std::move(mode)) {}
  void start(const wayproof::Task& task) override { task_ = task; }

  wayproof::Command step(const wayproof::Observation& observation) override {
    if (observation.sequence == 3 && mode_ == "throws") throw std::runtime_error("no map");
    std::printf("what a stack prints harms nobody\n");
    wayproof::Vector sum;
    const std::vector<wayproof::Vector> points = wayproof::returns(task_, observation);
    for (const wayproof::Vector& point : points) sum = sum + point;
    const wayproof::Vector& at = observation.reference_position;
    wayproof::Command command;
    command.waypoints = wayproof::Waypoints{{at + wayproof::Vector{0.1, 0.0, 0.0}, observation.goal}, 0.4};
    command.action = "follow";
    command.label = "none";
    command.reason = observation.last ? observation.last->fate : "first";
    command.planned_path = {at, task_.goal};
    command.map_version = "none";
    command.scalars = {{"count", static_cast<double>(points.size())},
                       {"x", sum.x},
                       {"y", sum.y},
                       {"z", sum.z},
                       {"seed", static_cast<double>(task_.seed)},
                       {"time_s", 1e-9 * static_cast<double>(observation.time_ns)},
                       {"below_zero", -1.5}};
    return command;
  }

 private:
  std::string mode_;
  wayproof::Task task_;
};

int main(int count, char** words) {
  Probe probe(count > 1 ? words[1] : "");
  return wayproof::serve(probe, "probe 1.0");
}
