// Pinocchio's algorithms over all samples of a motion, without Python in the loop.
// Input: joints, samples; per joint its parent, rotation (row by row), translation and ten dynamic
// parameters; rotor inertias; q, dq, ddq. Output: name and median milliseconds of each loop.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <vector>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/multibody.hpp>

namespace pin = pinocchio;
using Motion = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;  // one sample per column

static double now() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

static void report(const char *name, int repeats, const std::function<void()> &work) {
  work();
  std::vector<double> times;
  for (int k = 0; k < repeats; ++k) {
    const double started = now();
    work();
    times.push_back(now() - started);
  }
  std::sort(times.begin(), times.end());
  std::printf("%s %.6f\n", name, times[times.size() / 2]);
}

int main(int argc, char **argv) {
  if (argc < 3) return 2;
  std::FILE *file = std::fopen(argv[1], "rb");
  if (!file) return 3;
  std::fseek(file, 0, SEEK_END);
  std::vector<double> x(std::ftell(file) / sizeof(double));
  std::rewind(file);
  if (std::fread(x.data(), sizeof(double), x.size(), file) != x.size()) return 4;
  std::fclose(file);
  const double *at = x.data();
  const int joints = int(*at++), samples = int(*at++);
  pin::Model model;
  for (int i = 0; i < joints; ++i, at += 23) {
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> turn(at + 1);
    const pin::SE3 place(Eigen::Matrix3d(turn), Eigen::Vector3d(at + 10));
    const auto added = model.addJoint(pin::JointIndex(int(at[0]) + 1), pin::JointModelRZ(), place,
                                      "joint" + std::to_string(i));
    const Eigen::Matrix<double, 10, 1> dynamic(at + 13);
    const pin::Inertia link =
        dynamic[0] > 0 ? pin::Inertia::FromDynamicParameters(dynamic) : pin::Inertia::Random();
    model.appendBodyToJoint(added, link, pin::SE3::Identity());
  }
  model.armature = Eigen::Map<const Eigen::VectorXd>(at, joints);
  at += joints;
  const Eigen::Map<const Motion> q(at, joints, samples), dq(at + joints * samples, joints, samples),
      ddq(at + 2 * joints * samples, joints, samples);
  pin::Data data(model);
  Eigen::VectorXd q_k(joints), dq_k(joints), x_k(joints);
  double sum = 0;
  report("regressor", std::atoi(argv[2]), [&] {
    for (int k = 0; k < samples; ++k) {
      q_k = q.col(k), dq_k = dq.col(k), x_k = ddq.col(k);
      sum += pin::computeJointTorqueRegressor(model, data, q_k, dq_k, x_k)(0, 0);
    }
  });
  x_k.setZero();
  report("aba_four_times", std::atoi(argv[2]), [&] {
    for (int k = 0; k < samples; ++k) {
      q_k = q.col(k), dq_k = dq.col(k);
      for (int stage = 0; stage < 4; ++stage) sum += pin::aba(model, data, q_k, dq_k, x_k)[0];
    }
  });
  std::fprintf(stderr, "%g\n", sum);
  return 0;
}
