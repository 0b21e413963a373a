// A function of one vector as a list of instructions, evaluated in intervals or affine forms over many boxes.
#pragma once

#include <vector>

namespace armdyn {

enum class Operation { input, constant, output, assign, negate, twice, square, sine, cosine, add, subtract, multiply };

// Operation on values at places in memory: into = operation(first, second). An input is the argument at index `first`,
// a constant is `value`, an output goes to the result at index `into`.
struct Instruction {
  Operation operation = Operation::assign;
  int into = 0, first = 0, second = 0;
  double value = 0;
};

struct Program {
  std::vector<Instruction> instructions;
  int places = 0, inputs = 0, outputs = 0;
};

// Boxes are the last axis: every table is (…, boxes). On overflow the result is the whole line, or an infinite
// remainder.
// lower, upper: (inputs, boxes); found: (outputs, boxes), zero where the program has no entry.
void in_intervals(const Program& program, int boxes, const double* lower, const double* upper, double* found_lower,
                  double* found_upper);

// Forms c + Σ g_k ε_k ± r over the boxes, ε_k the distance of coordinate k from the middle over its radius.
// centre, radius: (inputs, boxes); found: c and r (outputs, boxes), g (outputs, inputs, boxes).
void in_affine_forms(const Program& program, int boxes, const double* centre, const double* radius,
                     double* found_centre, double* found_slopes, double* found_rest);

}  // namespace armdyn
