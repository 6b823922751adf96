// The stack interface of Wayproof, version 1, for C++17 on POSIX. One header, no dependencies.
//
// Subclass `wayproof::Stack`, and end `main` with `return wayproof::serve(stack, "my stack 1.0");`.
// `serve` answers the harness in lockstep on standard input and output until it closes them.
//
// SI units, world frame z up, quaternions w x y z, integer nanoseconds of simulated time. Fields and
// their numbers are those of harness/schema/stack.proto, in the same order; the fields of a message
// that this header does not know are skipped. To use the code that `protoc --cpp_out` generates from
// that file instead, keep `Pipe`, `serve` and the length before each message, and replace the rest.
#ifndef WAYPROOF_HPP
#define WAYPROOF_HPP

#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace wayproof {

constexpr std::uint32_t kVersion = 1;                // of the stack interface
constexpr std::uint32_t kLongestMessage = 64u << 20; // bytes
constexpr std::uint16_t kDropped = 0;                // range of a beam that was lost
constexpr std::uint16_t kNoReturn = 65535;           // range of a beam that met nothing within range

// ---- Messages -----------------------------------------------------------------------------------

struct Vector {
  double x = 0.0, y = 0.0, z = 0.0;
};

inline Vector operator+(const Vector& a, const Vector& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vector operator-(const Vector& a, const Vector& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vector operator*(double scale, const Vector& a) {
  return {scale * a.x, scale * a.y, scale * a.z};
}

// A disc of the footprint of an elongated body.
struct Disc {
  double offset = 0.0; // along the body's x axis, m
  double radius = 0.0; // m
};

struct Sensor {
  std::string name;
  std::string kind;                         // lidar, depth_camera or rangefinder
  double range_m = 0.0;
  double rate_hz = 0.0;
  std::vector<double> position_base_sensor; // 3, m
  std::vector<double> rotation_base_sensor; // 9, row-major
  std::vector<Vector> directions;           // of the beams, sensor frame; empty if a sweep has its own
  std::uint32_t beams = 0;                  // of a sweep
  std::string measures;                     // range: along the beam; depth: along the x axis
};

// The body, the operating area, the start, the goal and the sensors; comes once.
struct Task {
  std::string robot;
  std::uint64_t seed = 0;
  std::string motion;                // ground: in the plane; air: in space
  double radius = 0.0;               // circumscribed, m
  double height = 0.0;               // m
  double step_height = 0.0;          // m
  double max_speed = 0.0;            // m/s
  double max_acceleration = 0.0;     // m/s^2
  double max_jerk = 0.0;             // m/s^3
  double max_yaw_rate = 0.0;         // rad/s
  double sideways_speed = 0.0;       // m/s in any direction, whatever the body faces; else 0
  double rest_height = 0.0;          // of the base above the ground, of one that climbs; else 0, m
  double max_yaw_acceleration = 0.0; // rad/s^2; 0: no limit
  std::vector<Disc> discs;
  Vector low, high;                  // corners of the operating area, m
  Vector start;                      // m
  double start_heading = 0.0;        // rad
  Vector goal;                       // the last one, m; see Observation::goal
  std::vector<Vector> waypoints;     // goals before it, of a mission with several, m
  double goal_tolerance = 0.0;       // m
  double period_s = 0.0;             // from one observation to the next
  double delay_s = 0.0;              // from an observation to the effect of its command
  double deadline_s = 0.0;           // a command with a longer delay is discarded
  std::vector<Sensor> sensors;
  std::string settings;              // of sensors, map, costmap, planner, JSON

  const Sensor& sensor(const std::string& name) const {
    for (const Sensor& one : sensors)
      if (one.name == name) return one;
    throw std::runtime_error("no sensor '" + name + "' in the task");
  }
};

struct Sweep {
  std::string sensor;
  std::vector<std::uint16_t> ranges_mm; // as the sensor measures
  std::vector<std::uint8_t> classes;    // empty without semantics
  std::vector<Vector> directions;       // where they differ from sweep to sweep
};

struct Fate {
  std::uint32_t sequence = 0;
  std::string fate;    // followed, late or cut
  std::string verdict; // admitted, stale, unknown or blocked
};

struct Observation {
  std::uint64_t time_ns = 0;
  std::uint32_t sequence = 0;
  Vector position;                 // estimated, m
  std::vector<double> quaternion;  // estimated T_world_base, w x y z
  double position_sigma = 0.0;     // m
  double heading_sigma = 0.0;      // rad
  Vector velocity;                 // estimated, world, m/s
  double yaw_rate = 0.0;           // rad/s
  std::vector<Sweep> sweeps;
  std::uint64_t effect_ns = 0;     // when the command takes effect; the reference is of that time
  Vector reference_position;       // m
  Vector reference_velocity;       // m/s
  double reference_heading = 0.0;  // rad
  double reference_yaw_rate = 0.0; // rad/s
  bool at_rest = false;
  std::optional<Fate> last;        // of the command before; none at the first
  std::vector<double> trail_positions;   // poses during a rolling sweep, 3 each; else empty
  std::vector<double> trail_quaternions; // 4 each
  double trail_period_s = 0.0;
  std::vector<double> covariance;  // 4 x 4: x, y, z, m, and heading, rad; empty if none is stated
  std::vector<double> unheld;      // directions that the sweeps do not hold, 3 each, world
  Vector goal;                     // where to go now, m; it changes when a goal was reached
  std::uint32_t goals_reached = 0; // goals of the mission that were
};

// A velocity in the body's frame, held for a time; then the body brakes to rest.
struct Velocity {
  double forward = 0.0, left = 0.0, up = 0.0; // m/s
  double yaw_rate = 0.0;                      // rad/s
  double duration_s = 0.5;
};

// Points to pass through in straight lines, coming to rest at the last one.
struct Waypoints {
  std::vector<Vector> points; // world, m
  double speed = 0.0;         // limit, m/s; 0: the body's own
};

// The answer to one observation. Without a motion the body continues what it follows.
struct Command {
  std::optional<Velocity> velocity;
  std::optional<Waypoints> waypoints; // of the two, one at most
  std::string action;                 // empty: derived from the motion
  std::string label;
  std::string reason;                 // one line
  std::vector<Vector> planned_path;   // for the log
  std::string map_version;
  std::map<std::string, double> scalars; // a few named numbers for the log
};

// ---- The wire format of protobuf ----------------------------------------------------------------

// Reads the fields of one message, in any order. Throws std::runtime_error where it is none.
class Reader {
 public:
  Reader(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}

  // Advance to the next field; false at the end. `number()` is its number.
  bool next() {
    if (at_ == end_) return false;
    const std::uint64_t key = varint();
    number_ = static_cast<std::uint32_t>(key >> 3);
    type_ = static_cast<int>(key & 7);
    return true;
  }
  std::uint32_t number() const { return number_; }

  std::uint64_t integer() {
    expect(0);
    return varint();
  }
  double real() {
    expect(1);
    return fixed64();
  }
  std::string text() {
    const Reader part = message();
    return std::string(part.at_, part.end_);
  }
  Reader message() {
    expect(2);
    const std::uint64_t size = varint();
    const std::uint8_t* first = take(size);
    return Reader(first, static_cast<std::size_t>(size));
  }
  // Append to repeated numbers, which come packed or one by one.
  void reals(std::vector<double>& values) {
    if (type_ == 1) return values.push_back(fixed64());
    Reader part = message();
    while (part.at_ != part.end_) values.push_back(part.fixed64());
  }
  std::vector<std::uint8_t> bytes() {
    const Reader part = message();
    return std::vector<std::uint8_t>(part.at_, part.end_);
  }
  void skip() {
    if (type_ == 0) varint();
    else if (type_ == 1) take(8);
    else if (type_ == 2) message();
    else if (type_ == 5) take(4);
    else throw std::runtime_error("a field of an unknown type");
  }

 private:
  void expect(int type) const {
    if (type_ != type) throw std::runtime_error("a field of another type than expected");
  }
  const std::uint8_t* take(std::uint64_t count) {
    if (count > static_cast<std::uint64_t>(end_ - at_))
      throw std::runtime_error("a message that ends early");
    const std::uint8_t* first = at_;
    at_ += count;
    return first;
  }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const std::uint8_t byte = *take(1);
      value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    throw std::runtime_error("an integer of more than 10 bytes");
  }
  double fixed64() {
    const std::uint8_t* first = take(8);
    std::uint64_t bits = 0;
    for (int k = 7; k >= 0; --k) bits = bits << 8 | first[k];
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  const std::uint8_t* at_;
  const std::uint8_t* end_;
  std::uint32_t number_ = 0;
  int type_ = 0;
};

// Writes one message. A field of the default value is left out, as protobuf does.
class Writer {
 public:
  void integer(std::uint32_t number, std::uint64_t value) {
    if (value == 0) return;
    key(number, 0);
    varint(value);
  }
  void real(std::uint32_t number, double value) {
    if (bits(value) == 0) return;
    key(number, 1);
    fixed64(value);
  }
  void text(std::uint32_t number, const std::string& value) {
    if (!value.empty()) message(number, value);
  }
  // A part of the message, even an empty one.
  void message(std::uint32_t number, const std::string& data) {
    key(number, 2);
    varint(data.size());
    data_ += data;
  }
  void points(std::uint32_t number, const std::vector<Vector>& points) {
    if (points.empty()) return;
    Writer packed;
    for (const Vector& point : points)
      for (double value : {point.x, point.y, point.z}) packed.fixed64(value);
    message(number, packed.data_);
  }
  const std::string& data() const { return data_; }

 private:
  static std::uint64_t bits(double value) {
    std::uint64_t result;
    std::memcpy(&result, &value, sizeof result);
    return result;
  }
  void key(std::uint32_t number, std::uint32_t type) { varint(number << 3 | type); }
  void varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) data_ += static_cast<char>(value | 0x80);
    data_ += static_cast<char>(value);
  }
  void fixed64(double value) {
    for (int shift = 0; shift < 64; shift += 8) data_ += static_cast<char>(bits(value) >> shift);
  }

  std::string data_;
};

// ---- Reading the messages of the harness --------------------------------------------------------

inline Vector read_vector(Reader in) {
  Vector one;
  while (in.next()) switch (in.number()) {
      case 1: one.x = in.real(); break;
      case 2: one.y = in.real(); break;
      case 3: one.z = in.real(); break;
      default: in.skip();
    }
  return one;
}

inline Disc read_disc(Reader in) {
  Disc one;
  while (in.next()) switch (in.number()) {
      case 1: one.offset = in.real(); break;
      case 2: one.radius = in.real(); break;
      default: in.skip();
    }
  return one;
}

// Unit vectors, 3 float32 each, little-endian.
inline std::vector<Vector> read_directions(const std::vector<std::uint8_t>& data) {
  const auto number = [&data](std::size_t at) {
    std::uint32_t bits = 0;
    for (std::size_t k = 4; k-- > 0;) bits = bits << 8 | data[at + k];
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return static_cast<double>(value);
  };
  std::vector<Vector> all;
  for (std::size_t at = 0; at + 12 <= data.size(); at += 12)
    all.push_back({number(at), number(at + 4), number(at + 8)});
  return all;
}

inline Sensor read_sensor(Reader in) {
  Sensor one;
  while (in.next()) switch (in.number()) {
      case 1: one.name = in.text(); break;
      case 2: one.kind = in.text(); break;
      case 3: one.range_m = in.real(); break;
      case 4: one.rate_hz = in.real(); break;
      case 5: in.reals(one.position_base_sensor); break;
      case 6: in.reals(one.rotation_base_sensor); break;
      case 7: one.directions = read_directions(in.bytes()); break;
      case 8: one.beams = static_cast<std::uint32_t>(in.integer()); break;
      case 10: one.measures = in.text(); break;
      default: in.skip();
    }
  if (one.position_base_sensor.size() != 3 || one.rotation_base_sensor.size() != 9)
    throw std::runtime_error("sensor '" + one.name + "' without a mounting");
  return one;
}

inline Task read_task(Reader in) {
  Task one;
  while (in.next()) switch (in.number()) {
      case 1: one.robot = in.text(); break;
      case 2: one.seed = in.integer(); break;
      case 3: one.motion = in.text(); break;
      case 4: one.radius = in.real(); break;
      case 5: one.height = in.real(); break;
      case 6: one.step_height = in.real(); break;
      case 7: one.max_speed = in.real(); break;
      case 8: one.max_acceleration = in.real(); break;
      case 9: one.max_jerk = in.real(); break;
      case 10: one.max_yaw_rate = in.real(); break;
      case 11: one.discs.push_back(read_disc(in.message())); break;
      case 12: one.low = read_vector(in.message()); break;
      case 13: one.high = read_vector(in.message()); break;
      case 14: one.start = read_vector(in.message()); break;
      case 15: one.start_heading = in.real(); break;
      case 16: one.goal = read_vector(in.message()); break;
      case 17: one.goal_tolerance = in.real(); break;
      case 18: one.period_s = in.real(); break;
      case 19: one.delay_s = in.real(); break;
      case 20: one.deadline_s = in.real(); break;
      case 21: one.sensors.push_back(read_sensor(in.message())); break;
      case 22: one.settings = in.text(); break;
      case 23: one.waypoints.push_back(read_vector(in.message())); break;
      case 25: one.sideways_speed = in.real(); break;
      case 26: one.rest_height = in.real(); break;
      case 27: one.max_yaw_acceleration = in.real(); break;
      default: in.skip();
    }
  return one;
}

inline Sweep read_sweep(Reader in) {
  Sweep one;
  while (in.next()) switch (in.number()) {
      case 1: one.sensor = in.text(); break;
      case 2: {
        const std::vector<std::uint8_t> data = in.bytes();
        for (std::size_t at = 0; at + 2 <= data.size(); at += 2)
          one.ranges_mm.push_back(static_cast<std::uint16_t>(data[at] | data[at + 1] << 8));
        break;
      }
      case 3: one.classes = in.bytes(); break;
      case 4: one.directions = read_directions(in.bytes()); break;
      default: in.skip();
    }
  return one;
}

inline Fate read_fate(Reader in) {
  Fate one;
  while (in.next()) switch (in.number()) {
      case 1: one.sequence = static_cast<std::uint32_t>(in.integer()); break;
      case 2: one.fate = in.text(); break;
      case 3: one.verdict = in.text(); break;
      default: in.skip();
    }
  return one;
}

inline Observation read_observation(Reader in) {
  Observation one;
  while (in.next()) switch (in.number()) {
      case 1: one.time_ns = in.integer(); break;
      case 2: one.sequence = static_cast<std::uint32_t>(in.integer()); break;
      case 3: one.position = read_vector(in.message()); break;
      case 4: in.reals(one.quaternion); break;
      case 5: one.position_sigma = in.real(); break;
      case 6: one.heading_sigma = in.real(); break;
      case 7: one.velocity = read_vector(in.message()); break;
      case 8: one.yaw_rate = in.real(); break;
      case 9: one.sweeps.push_back(read_sweep(in.message())); break;
      case 10: one.effect_ns = in.integer(); break;
      case 11: one.reference_position = read_vector(in.message()); break;
      case 12: one.reference_velocity = read_vector(in.message()); break;
      case 13: one.reference_heading = in.real(); break;
      case 14: one.reference_yaw_rate = in.real(); break;
      case 15: one.at_rest = in.integer() != 0; break;
      case 16: one.last = read_fate(in.message()); break;
      case 17: in.reals(one.trail_positions); break;
      case 18: in.reals(one.trail_quaternions); break;
      case 19: one.trail_period_s = in.real(); break;
      case 20: in.reals(one.covariance); break;
      case 21: in.reals(one.unheld); break;
      case 22: one.goal = read_vector(in.message()); break;
      case 23: one.goals_reached = static_cast<std::uint32_t>(in.integer()); break;
      default: in.skip();
    }
  if (one.quaternion.size() != 4) throw std::runtime_error("an observation without a pose");
  return one;
}

// ---- Writing the messages of the stack ----------------------------------------------------------

inline std::string hello_message(const std::string& name) {
  Writer hello, out;
  hello.integer(1, kVersion);
  hello.text(2, name);
  out.message(1, hello.data());
  return out.data();
}

inline std::string command_message(const Command& command, std::uint32_t sequence) {
  Writer body, out;
  if (command.velocity) {
    const Velocity& velocity = *command.velocity;
    Writer part;
    part.real(1, velocity.forward);
    part.real(2, velocity.left);
    part.real(3, velocity.up);
    part.real(4, velocity.yaw_rate);
    part.real(5, velocity.duration_s);
    body.message(3, part.data());
  } else if (command.waypoints) {
    Writer part;
    part.points(1, command.waypoints->points);
    part.real(2, command.waypoints->speed);
    body.message(4, part.data());
  }
  body.integer(5, sequence);
  body.text(6, command.action);
  body.text(7, command.label);
  body.text(8, command.reason);
  body.points(9, command.planned_path);
  body.text(10, command.map_version);
  for (const auto& [name, value] : command.scalars) {
    Writer entry;
    entry.text(1, name);
    entry.real(2, value);
    body.message(11, entry.data());
  }
  out.message(2, body.data());
  return out.data();
}

inline std::string failure_message(const std::string& text) {
  Writer failure, out;
  failure.text(1, text);
  out.message(3, failure.data());
  return out.data();
}

// ---- Serving ------------------------------------------------------------------------------------

// A navigation stack on trial.
class Stack {
 public:
  virtual ~Stack() = default;
  virtual void start(const Task& task) = 0;
  virtual Command step(const Observation& observation) = 0;
};

// Messages with their length before them, over two file descriptors (or a socket twice).
class Pipe {
 public:
  Pipe(int read, int write) : read_(read), write_(write) {}

  // Receive one message; false at the end of the input.
  bool receive(std::vector<std::uint8_t>& data) {
    std::uint8_t head[4];
    if (!fill(head, 4)) return false;
    std::uint32_t size = 0;
    for (int k = 3; k >= 0; --k) size = size << 8 | head[k];
    if (size > kLongestMessage) throw std::runtime_error("a message that is too long");
    data.resize(size);
    return fill(data.data(), size);
  }

  // Send one message; false once nobody reads any more.
  bool send(const std::string& message) {
    std::string data;
    for (int shift = 0; shift < 32; shift += 8) data += static_cast<char>(message.size() >> shift);
    data += message;
    for (std::size_t sent = 0; sent < data.size();) {
      const ssize_t count = ::write(write_, data.data() + sent, data.size() - sent);
      if (count > 0) sent += static_cast<std::size_t>(count);
      else if (errno != EINTR) return false;
    }
    return true;
  }

 private:
  bool fill(std::uint8_t* data, std::size_t size) {
    for (std::size_t got = 0; got < size;) {
      const ssize_t count = ::read(read_, data + got, size - got);
      if (count > 0) got += static_cast<std::size_t>(count);
      else if (count == 0 || errno != EINTR) return false;
    }
    return true;
  }

  int read_, write_;
};

// Answer the harness until it closes the connection; return the exit code of `main`. What the stack
// throws ends the episode, with its text as the reason.
inline int serve(Stack& stack, const std::string& name, Pipe pipe) {
  std::signal(SIGPIPE, SIG_IGN); // `send` returns false instead
  std::vector<std::uint8_t> data;
  try {
    while (pipe.receive(data)) {
      Reader in(data.data(), data.size());
      while (in.next()) {
        std::string answer;
        switch (in.number()) {
          case 1: in.skip(); answer = hello_message(name); break;
          case 2: stack.start(read_task(in.message())); continue;
          case 3: {
            const Observation observation = read_observation(in.message());
            answer = command_message(stack.step(observation), observation.sequence);
            break;
          }
          case 4: return 0;
          default: in.skip(); continue;
        }
        if (!pipe.send(answer)) return 0;
      }
    }
    return 0;
  } catch (const std::exception& error) {
    pipe.send(failure_message(error.what()));
    return 1;
  }
}

// On standard input and output. What the stack itself prints goes to standard error from now on.
inline int serve(Stack& stack, const std::string& name) {
  const Pipe pipe(::dup(0), ::dup(1));
  ::dup2(2, 1);
  return serve(stack, name, pipe);
}

// ---- Geometry -----------------------------------------------------------------------------------

// A vector of the base's frame in the world, by a quaternion w x y z.
inline Vector rotated(const std::vector<double>& q, const Vector& v) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {(1 - 2 * (y * y + z * z)) * v.x + 2 * (x * y - w * z) * v.y + 2 * (x * z + w * y) * v.z,
          2 * (x * y + w * z) * v.x + (1 - 2 * (x * x + z * z)) * v.y + 2 * (y * z - w * x) * v.z,
          2 * (x * z - w * y) * v.x + 2 * (y * z + w * x) * v.y + (1 - 2 * (x * x + y * y)) * v.z};
}

// The returns of all sweeps as points in the world, m, as if each sweep were of one instant.
inline std::vector<Vector> returns(const Task& task, const Observation& observation) {
  std::vector<Vector> points;
  for (const Sweep& sweep : observation.sweeps) {
    const Sensor& sensor = task.sensor(sweep.sensor);
    const auto& beams = sweep.directions.empty() ? sensor.directions : sweep.directions;
    if (beams.size() != sweep.ranges_mm.size())
      throw std::runtime_error("a sweep of another size than its sensor '" + sensor.name + "'");
    const auto& R = sensor.rotation_base_sensor;
    const auto& p = sensor.position_base_sensor;
    const bool is_depth = sensor.measures == "depth";
    for (std::size_t k = 0; k < beams.size(); ++k) {
      if (sweep.ranges_mm[k] == kDropped || sweep.ranges_mm[k] == kNoReturn) continue;
      const double range = 1e-3 * sweep.ranges_mm[k] / (is_depth ? beams[k].x : 1.0);
      const Vector b = range * beams[k];
      const Vector in_base{p[0] + R[0] * b.x + R[1] * b.y + R[2] * b.z,
                           p[1] + R[3] * b.x + R[4] * b.y + R[5] * b.z,
                           p[2] + R[6] * b.x + R[7] * b.y + R[8] * b.z};
      points.push_back(observation.position + rotated(observation.quaternion, in_base));
    }
  }
  return points;
}

inline double wrap_angle(double angle) {
  return std::remainder(angle, 2.0 * 3.14159265358979323846);
}

}  // namespace wayproof

#endif  // WAYPROOF_HPP
