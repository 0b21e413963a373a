// Function of columns of numbers: compiled C, or CasADi's virtual machine without a compiler.
#pragma once

#include <casadi/casadi.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace armdyn {

// Generated C function of a CasADi Function, which must stay loaded; or the serialized Function.
struct CallableSource {
  std::uintptr_t address = 0;         // C function; 0: none
  std::array<std::size_t, 4> work{};  // workspace: arguments, results, integers, numbers
  std::string serialized;             // casadi::Function, without a C function
};

// Caller with its own workspace, one per thread. It is created and destroyed under a lock, as CasADi counts references
// to expressions without locks; calls may run concurrently.
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
