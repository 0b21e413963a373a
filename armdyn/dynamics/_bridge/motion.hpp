// Motions of an arm under torques that are linear from sample to sample.
//
// Tables by rows: states (samples, 2 nv) of positions and velocities, torques (samples, nv).
#pragma once

#include "arm.hpp"

#include <cstddef>
#include <vector>

namespace armdyn {

// An explicit Runge-Kutta method like Dormand and Prince's 8(5,3): its last stage is the rate at the end.
struct ExplicitMethod {
  std::size_t stages = 0;                // s, without the last
  std::vector<double> A, b, c;           // (s, s), (s), (s)
  std::vector<double> error3, error5;    // of the embedded methods, (s + 1)
};

// Torque range |tau + slopes v| <= rests in every row, within lower and upper (nv each).
struct TorqueRange {
  std::vector<double> lower, upper, slopes, rests;
};

struct SampledTorques {
  std::vector<double> t;                 // (samples) [s]
  std::vector<double> tau, tau_end;      // (samples, nv), (samples - 1, nv): at the start and end of an interval
  std::vector<unsigned char> jumps;      // (samples - 1): whether an interval is a jump
};

// States under the torques from x (2 nv) at the first sample on, as far as they are finite and all steps succeed. A
// step goes from sample to sample; a step whose estimated error exceeds rtol (absolute: 1e-2 of that) is halved. Its
// evaluations are counted against `spare`.
std::vector<double> replay(Arm& arm, const ExplicitMethod& method, const SampledTorques& torques, std::vector<double> x,
                           double rtol, long spare);

struct Tracking {
  std::vector<double> desired;            // desired states (samples, 2 nv)
  std::vector<double> fade;              // (samples - 1): share of the feedback
  double bandwidth = 0;                  // of the feedback [1/s]
  int clips = 0;                         // rounds of clipping a torque in the state that it leads to
};

// The same, with torques at the samples corrected by feedback to the desired states and clipped to the range.
// They are overwritten; `spare` is per sample.
std::vector<double> track(Arm& arm, const ExplicitMethod& method, SampledTorques& torques, const Tracking& tracking,
                          const TorqueRange& range, std::vector<double> x, double rtol, long spare);

// Collocation of s stages for the second-order equations of motion.
struct ImplicitMethod {
  std::size_t stages = 0;
  std::vector<double> A, b, c;           // (s, s), (s), (s)
  double tolerance = 0;                  // of stage velocities, relative to 1 and the velocity, over the last two steps
  double stalled = 0;                    // the same once Newton's steps no longer halve
  int most = 0;                          // Newton steps
};

struct ImplicitSteps {
  std::vector<double> end;               // states (segments, 2 nv); not numbers where Newton's method does not converge
  std::vector<double> state_transition;  // in the start state, (segments, 2 nv, 2 nv)
  std::vector<double> forced;            // in a constant torque, (segments, 2 nv, nv)
};

// Segments with lengths h, start states x, and torques at their starts and ends tau (segments, 2, nv),
// by a number of equal steps.
ImplicitSteps implicit_steps(Arm& arm, const ImplicitMethod& method, const std::vector<double>& h,
                             const std::vector<double>& x, const std::vector<double>& tau, int parts);

}  // namespace armdyn
