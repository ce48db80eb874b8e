// Whole runs of a rigid tree in C++: the articulated-body algorithm of Pinocchio, stepped by Boost's odeint; and its
// derivatives of forward and inverse dynamics. Nothing of Python is in the loop. tests/benchmarks/compiled/pinocchio.py compiles this file and calls it.
#include <pinocchio/multibody.hpp>

#include <boost/numeric/odeint.hpp>
#include <memory>
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/serialization.hpp>
#include <string>
#include <vector>

namespace odeint = boost::numeric::odeint;
using State = std::vector<double>;  // coordinates, then speeds; as many of both, since no joint has a quaternion

struct Tree
{
  pinocchio::Model model;
  std::unique_ptr<pinocchio::Data> data;
  Eigen::VectorXd tau;
};

extern "C" Tree * load_tree(const char * file)
{
  auto * tree = new Tree;
  pinocchio::serialization::loadFromBinary(tree->model, std::string(file));
  tree->data = std::make_unique<pinocchio::Data>(tree->model);
  tree->tau = Eigen::VectorXd::Zero(tree->model.nv);
  return tree;
}

// Integrates y (2 nv) in place from 0 to t_end and returns the number of accepted steps. odeint accepts a step where
// every component's error is at most atol + rtol (|y| + h |dy/dt|).
template<class Stepper>
static long stepped(Tree & tree, double * y, double t_end, double rtol, double atol, Stepper stepper)
{
  const int n = tree.model.nv;
  const auto rate = [&](const State & x, State & dx, double) {
    const Eigen::Map<const Eigen::VectorXd> q(x.data(), n), v(x.data() + n, n);
    Eigen::Map<Eigen::VectorXd>(dx.data(), n) = v;
    Eigen::Map<Eigen::VectorXd>(dx.data() + n, n) = pinocchio::aba(tree.model, *tree.data, q, v, tree.tau);
  };
  State state(y, y + 2 * n);
  const auto controlled = odeint::make_controlled(atol, rtol, stepper);
  const double first_step = 1e-3 * t_end;
  const auto steps = odeint::integrate_adaptive(controlled, rate, state, 0.0, t_end, first_step);
  std::copy(state.begin(), state.end(), y);
  return static_cast<long>(steps);
}

extern "C" long run_dopri5(Tree * tree, double * y, double t_end, double rtol, double atol)
{
  return stepped(*tree, y, t_end, rtol, atol, odeint::runge_kutta_dopri5<State>());
}

extern "C" long run_fehlberg78(Tree * tree, double * y, double t_end, double rtol, double atol)
{
  return stepped(*tree, y, t_end, rtol, atol, odeint::runge_kutta_fehlberg78<State>());
}

// Derivatives by q, v and forces or accelerations x, `times` times over; the last ones, (nv,nv) each, by columns to out.
// The third matrix has its upper triangle only.
extern "C" void derivatives(Tree * tree, const double * state, const double * x, double * out, long times, int inverse)
{
  const int n = tree->model.nv;
  const Eigen::Map<const Eigen::VectorXd> q(state, n), v(state + n, n), given(x, n);
  pinocchio::Data & data = *tree->data;
  for (long i = 0; i < times; ++i)
    if (inverse)
      pinocchio::computeRNEADerivatives(tree->model, data, q, v, given);
    else
      pinocchio::computeABADerivatives(tree->model, data, q, v, given);
  const auto matrix = [&](int k) { return Eigen::Map<Eigen::MatrixXd>(out + k * n * n, n, n); };
  matrix(0) = inverse ? Eigen::MatrixXd(data.dtau_dq) : Eigen::MatrixXd(data.ddq_dq);
  matrix(1) = inverse ? Eigen::MatrixXd(data.dtau_dv) : Eigen::MatrixXd(data.ddq_dv);
  matrix(2) = inverse ? Eigen::MatrixXd(data.M) : Eigen::MatrixXd(data.Minv);
}
