// A function of columns of numbers: compiled C, or casadi's virtual machine where there is no compiler.
#pragma once

#include <casadi/casadi.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace armdyn {

// What casadi's code generation makes of a Function, which must stay loaded; or the Function itself.
struct CallableSource {
  std::uintptr_t address = 0;         // of the C function; 0: none
  std::array<std::size_t, 4> work{};  // its sizes: arguments, results, integers, numbers
  std::string serialized;             // of the casadi::Function, where there is no C function
};

// One caller's: it has work space of its own, so that each thread has one. It is made and destroyed by one thread at a
// time, as casadi's expressions are counted without locks; calls may run side by side.
class Callable {
 public:
  explicit Callable(const CallableSource& source) : compiled_(reinterpret_cast<casadi::eval_t>(source.address)) {
    auto work = source.work;
    if (!compiled_) {
      function_ = casadi::Function::deserialize(source.serialized);
      memory_ = function_.checkout();
      work = {function_.sz_arg(), function_.sz_res(), function_.sz_iw(), function_.sz_w()};
    }
    arguments_.resize(work[0]);
    results_.resize(work[1]);
    integers_.resize(work[2] + 1);
    numbers_.resize(work[3] + 1);
  }
  Callable(const Callable&) = delete;
  Callable& operator=(const Callable&) = delete;
  ~Callable() {
    if (!compiled_) function_.release(memory_);
  }

  const double*& argument(std::size_t i) { return arguments_[i]; }

  void operator()(double* result) {
    results_[0] = result;
    if (compiled_) {
      compiled_(arguments_.data(), results_.data(), integers_.data(), numbers_.data(), 0);
    } else {
      function_(arguments_.data(), results_.data(), integers_.data(), numbers_.data(), memory_);
    }
  }

 private:
  casadi::Function function_;
  casadi::eval_t compiled_;
  int memory_ = 0;
  std::vector<const double*> arguments_;
  std::vector<double*> results_;
  std::vector<casadi_int> integers_;
  std::vector<double> numbers_;
};

}  // namespace armdyn
