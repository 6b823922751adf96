// A reactive stack: drives at the goal, turns to where the returns leave room, slows down for them.
//
//   c++ -O2 -std=c++17 -o stack examples/cpp/stack.cpp
//   wayproof run cylinders --robot quadruped --seed 2 --stack exec:./stack
//
// It has no map, so it knows nothing of what it does not see now. Start from here: replace `step`.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "wayproof.hpp"

namespace {

constexpr double kReach = 4.0;       // distance within which returns count, m
constexpr double kMargin = 0.15;     // distance kept to returns beyond the body's radius, m
constexpr double kAhead = 1.5;       // time in which the room ahead would be driven, s
constexpr double kTurnFirst = 0.5;   // bearing beyond which it turns on the spot, rad
constexpr int kBearings = 72;        // that are tried, all around
constexpr double kPi = 3.14159265358979323846;

class Reactive : public wayproof::Stack {
 public:
  void start(const wayproof::Task& task) override { task_ = task; }

  wayproof::Command step(const wayproof::Observation& observation) override {
    const wayproof::Vector to_goal = observation.goal - observation.reference_position;
    const double away = std::hypot(to_goal.x, to_goal.y);
    const double climb = task_.motion == "air" ? std::clamp(to_goal.z, -0.5, 0.5) : 0.0;
    wayproof::Command command;
    command.scalars["away_m"] = away;
    if (away <= 0.5 * task_.goal_tolerance) {
      command.velocity = {0.0, 0.0, climb, 0.0, 0.5};
      command.reason = "at the goal";
      return command;
    }
    const std::vector<wayproof::Vector> near = obstacles(observation);
    const double heading = observation.reference_heading;
    const double at_goal = wayproof::wrap_angle(std::atan2(to_goal.y, to_goal.x) - heading);
    const double enough = std::min(kReach, away);
    double bearing = 0.0, room = 0.0, least = 1e9;
    for (int k = 0; k < kBearings; ++k) {
      const double tried = wayproof::wrap_angle(at_goal + 2.0 * kPi * k / kBearings);
      const double free = free_length(near, heading + tried);
      const double off = std::abs(wayproof::wrap_angle(tried - at_goal));
      const double cost = off + 4.0 * std::max(1.0 - free / enough, 0.0);
      if (cost < least) least = cost, bearing = tried, room = free;
    }
    const bool turns = std::abs(bearing) > kTurnFirst;
    const double speed = turns ? 0.0 : std::min({task_.max_speed, room / kAhead, away});
    const double yaw_rate = std::clamp(2.0 * bearing, -task_.max_yaw_rate, task_.max_yaw_rate);
    command.velocity = {speed, 0.0, climb, yaw_rate, 0.5};
    command.reason = turns ? "turn to where there is room" : "drive at the goal";
    command.scalars["room_m"] = room;
    return command;
  }

 private:
  // Returns at the height of the body and within reach, relative to where the body will be.
  std::vector<wayproof::Vector> obstacles(const wayproof::Observation& observation) const {
    const double z = observation.position.z;
    const bool flies = task_.motion == "air";
    const double low = flies ? z - 0.5 * task_.height - 0.1 : task_.step_height;
    const double high = flies ? z + 0.5 * task_.height + 0.1 : z + 0.3;
    std::vector<wayproof::Vector> near;
    for (const wayproof::Vector& point : wayproof::returns(task_, observation)) {
      const wayproof::Vector offset = point - observation.reference_position;
      if (point.z > low && point.z < high && std::hypot(offset.x, offset.y) < kReach)
        near.push_back(offset);
    }
    return near;
  }

  // How far a disc of the body's size moves straight in a direction before it touches a return, m.
  double free_length(const std::vector<wayproof::Vector>& near, double direction) const {
    const double cosine = std::cos(direction), sine = std::sin(direction);
    const double width = task_.radius + kMargin;
    double free = kReach;
    for (const wayproof::Vector& one : near) {
      const double along = cosine * one.x + sine * one.y;
      const double across = cosine * one.y - sine * one.x;
      if (along > 0.0 && std::abs(across) < width)
        free = std::min(free, along - std::sqrt(width * width - across * across));
    }
    return std::max(free, 0.0);
  }

  wayproof::Task task_;
};

}  // namespace

int main() {
  Reactive stack;
  return wayproof::serve(stack, "reactive 1.0");
}
