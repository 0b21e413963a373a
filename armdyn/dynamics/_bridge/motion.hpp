// Motions of an arm under torques that are linear from sample to sample.
//
// Tables are row after row: states (samples, 2 nv) of positions and velocities, torques (samples, nv).
#pragma once

#include "arm.hpp"

#include <cstddef>
#include <vector>

namespace armdyn {

// An explicit Runge-Kutta method of the kind of Dormand and Prince's 8(5,3): its last stage is the rate at the end.
struct ExplicitMethod {
  std::size_t stages = 0;                // s, without the last
  std::vector<double> A, b, c;           // (s, s), (s), (s)
  std::vector<double> error3, error5;    // of the embedded methods, (s + 1)
};

// Torque range |tau + slopes v| <= rests in every row, and between lower and upper (nv each).
struct TorqueRange {
  std::vector<double> lower, upper, slopes, rests;
};

struct SampledTorques {
  std::vector<double> t;                 // (samples) [s]
  std::vector<double> tau, tau_end;      // (samples, nv) and (samples - 1, nv): where each interval begins and ends
  std::vector<unsigned char> jumps;      // (samples - 1): no time passes
};

// States under the torques from x (2 nv) at the first sample on, as far as they are finite and every step can be made.
// A step is from sample to sample; one whose error by the method's own estimate is above rtol (absolute: 1e-2 of that)
// is made in halves. Evaluations for these are taken from `spare`.
std::vector<double> replay(Arm& arm, const ExplicitMethod& method, const SampledTorques& torques, std::vector<double> x,
                           double rtol, long spare);

struct Tracking {
  std::vector<double> wanted;            // states (samples, 2 nv)
  std::vector<double> fade;              // (samples - 1): share of the feedback that acts
  double bandwidth = 0;                  // of the feedback [1/s]
  int clips = 0;                         // rounds in which a torque is clipped in the state that it leads to
};

// The same with torques at the samples led by feedback to the wanted states and clipped to the range.
// They are changed in place; `spare` is for each sample.
std::vector<double> track(Arm& arm, const ExplicitMethod& method, SampledTorques& torques, const Tracking& tracking,
                          const TorqueRange& range, std::vector<double> x, double rtol, long spare);

// Collocation of s stages for the second-order equations of motion.
struct ImplicitMethod {
  std::size_t stages = 0;
  std::vector<double> A, b, c;           // (s, s), (s), (s)
  double tolerance = 0;                  // of stage velocities, relative to 1 and the velocity, by the last two steps
  double stalled = 0;                    // the same where Newton's steps no longer halve
  int most = 0;                          // Newton steps
};

struct ImplicitSteps {
  std::vector<double> end;               // states (segments, 2 nv); not numbers where Newton's method does not converge
  std::vector<double> state_transition;  // by the start state, (segments, 2 nv, 2 nv)
  std::vector<double> forced;            // by a constant torque, (segments, 2 nv, nv)
};

// Segments, each of its own length h, start state x and torques at its start and its end tau (segments, 2, nv),
// by so many equal steps.
ImplicitSteps implicit_steps(Arm& arm, const ImplicitMethod& method, const std::vector<double>& h,
                             const std::vector<double>& x, const std::vector<double>& tau, int parts);

}  // namespace armdyn
