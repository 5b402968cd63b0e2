// The exact interpretation tree with posekit's own checks: the same steps as posekit/tree/tree.py.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <stdexcept>
#include <vector>

#include "../solver/limits.hpp"

namespace py = pybind11;

namespace {

constexpr int PARENT[J] = {-1, 0, 0, 0, 3, 3, 1, 2, 6, 7, 4, 5, 10, 11};
constexpr int FIRST[J] = {0, 1, 3, 5, 7, 11, 15, 19, 23, 31, 39, 47, 55, 71};  // column of each joint's first candidate
constexpr double PARALLEL = 1e-30, NEAR = 0.1;  // as in geometry/segments.py and validators/collision.py
enum Kind { BRANCH, DISTANCE, TORSO, PELVIS, LIMB, CAPSULES };

// Level, number of the first reason, and then the numbers of a `Step` of steps.py.
struct Step {
  double level, reason, kind, limb, tolerance, points[8], numbers[14];
};
struct Verdict {
  int place;  // place of the first violation; PASSED if there is none, UNKNOWN before the judgement
  double value, lower, upper;
  std::int64_t frame = -1;  // that was judged
};
constexpr int PASSED = -1;

// Column of a joint's position at a node; the lowest bit of the candidate is the joint's own branch.
int column_of(int joint, int level, std::int64_t code) {
  int candidate = 0;
  for (int j = joint, k = 0; j > 0; j = PARENT[j]) candidate |= (code >> (level - j) & 1) << k++;
  return FIRST[joint] + candidate;
}

// Distance between segments g + t b and s a with s and t in [-1, 1] (geometry/segments.py).
double segment_distance(Vec g, Vec a, Vec b) {
  const double aa = dot(a, a), bb = dot(b, b), ab = dot(a, b), ag = dot(a, g), bg = dot(b, g);
  const Vec normal = cross(a, b);
  const double determinant = dot(normal, normal), da = aa > 0 ? aa : 1, db = bb > 0 ? bb : 1;
  auto clip = [](double x) { return std::min(std::max(x, -1.0), 1.0); };
  const double s = determinant <= PARALLEL * aa * bb ? 0 : dot(normal, cross(g, b)) / determinant;
  double least = INFINITY;
  auto attempt = [&](double on_a, double on_b) {
    const Vec apart = g + on_b * b - on_a * a;
    least = std::min(least, dot(apart, apart));
  };
  for (double t : {clip((clip(s) * ab - bg) / db), -1.0, 1.0}) attempt(clip((ag + t * ab) / da), t);
  for (double end : {-1.0, 1.0}) attempt(end, clip((end * ab - bg) / db));
  return std::sqrt(least);
}

// Largest distance between the torso's joints and a rigid torso (or its mirror image) placed on them.
double placement(const Frame& R, const double x[J][3], const double* torso, double mirror) {
  double most = 0;
  for (int j = 0; j < 4; ++j, torso += 3) {
    const Vec at = vec(x[0]) + (mirror * torso[0]) * R.forward + torso[1] * R.left + torso[2] * R.up;
    most = std::max(most, norm(at - vec(x[j])));
  }
  return most;
}

Verdict judged(const Step& s, const Limits& L, const double x[J][3]) {
  const double* n = s.numbers;
  Verdict found{PASSED, 0, 0, 0};
  auto test = [&](int place, double value, double lower, double upper, double tolerance) {
    if (found.place == PASSED && std::min(value - lower, upper - value) < -tolerance)
      found = {place, value, lower, upper};
  };
  auto point = [&](int k) { return vec(x[(int)s.points[k]]); };
  switch ((int)s.kind) {
    case DISTANCE: test(0, norm(point(1) - point(0)), n[0], n[0], s.tolerance); break;
    case TORSO: {
      const Frame R = torso_of(x);
      double value = placement(R, x, n, 1);
      if (n[12] > 0 && value > s.tolerance && placement(R, x, n, -1) <= s.tolerance) value = NAN;
      test(0, value, -INFINITY, s.tolerance, 0);
      break;
    }
    case PELVIS: {
      const Pelvis angles = pelvis_of(torso_of(x), hips_of(x, L.between_hips > 0));
      const double unit = 180 / M_PI;
      for (int k = 0; k < 3; ++k)
        test(k, angles.g[k] * PELVIS_SIGN[k] * unit, L.pelvis[k][0] * unit, L.pelvis[k][1] * unit, s.tolerance);
      break;
    }
    case LIMB: {
      const int m = (int)s.limb;
      const Frame R = m < 2 ? torso_of(x) : hips_of(x, L.between_hips > 0);
      const Stated one = stated(L, m, limb_of(x, m, R).g, s.tolerance, 0);
      const bool arm = m < 2 && L.by_elevation > 0;
      for (int i = 0, place = 0; i < 4; ++i)
        if (!(arm && i == 1)) test(place++, one.row[0][i], one.row[1][i], one.row[2][i], one.row[3][i]);
      break;
    }
    case CAPSULES: {
      Vec middle[2], half[2];
      for (int k = 0; k < 2; ++k) {
        const Vec start = point(2 * k), along = point(2 * k + 1) - start;
        const Vec axis = (1 / norm(along)) * along;
        middle[k] = start + n[2 * k] * axis, half[k] = n[2 * k + 1] * axis;
      }
      const Vec gap = middle[1] - middle[0];
      const double radii = n[4], margin = n[5];
      double distance = norm(gap) - (n[1] + n[3] + radii);
      if (distance < NEAR + std::max(margin, 0.0)) distance = segment_distance(gap, half[0], half[1]) - radii;
      test(0, distance, margin, INFINITY, s.tolerance);
    }
  }
  return found;
}

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Longs = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
using Bytes = py::array_t<std::int8_t, py::array::c_style | py::array::forcecast>;

// A step, the joints that it reads, the joints whose branches determine their positions, and the verdicts of a frame.
struct Ask {
  const Step* step;
  std::vector<int> reads, support;
  std::vector<Verdict> known;
  explicit Ask(const Step& one) : step(&one) {
    bool on[J] = {};
    for (double point : one.points) {
      if (point >= 0) reads.push_back((int)point);
      for (int j = (int)point; j > 0; j = PARENT[j]) on[j] = true;
    }
    for (int j = 1; j < J; ++j)
      if (on[j]) support.push_back(j);
    known.resize(std::size_t(1) << support.size());
  }
};

// Applies consecutive steps to nodes (ordered by frame); returns the remaining nodes and the pruned branches.
py::tuple grow(Doubles table, Bytes state, Doubles excess, py::object ranges, Doubles steps, Longs frame, Longs code) {
  if (steps.shape(1) * sizeof(double) != sizeof(Step)) throw std::invalid_argument("steps of another layout");
  Limits L{};
  if (!ranges.is_none()) {
    const py::array array = py::cast<py::array>(ranges);
    if (array.itemsize() != (py::ssize_t)sizeof L) throw std::invalid_argument("limits of another layout");
    std::memcpy(&L, array.data(), sizeof L);
  }
  std::vector<Ask> asks;
  for (py::ssize_t k = 0; k < steps.shape(0); ++k) asks.emplace_back(reinterpret_cast<const Step*>(steps.data())[k]);
  std::vector<std::int64_t> left_frame, left_code, lost, nodes, next;
  std::vector<double> numbers;
  double x[J][3] = {};
  for (py::ssize_t at = 0, end = 0; at < frame.size(); at = end) {
    const std::int64_t f = frame.data()[at];
    for (nodes.clear(); end < frame.size() && frame.data()[end] == f; ++end) nodes.push_back(code.data()[end]);
    const double(*positions)[3] = reinterpret_cast<const double(*)[3]>(table.data() + f * table.shape(1) * 3);
    const std::int8_t* states = state.data() + f * state.shape(1);
    const double* shortfall = excess.data() + f * state.shape(1);
    for (Ask& ask : asks) {
      const Step& s = *ask.step;
      const int level = (int)s.level;
      auto lose = [&](std::int64_t node, int place, double value, double lower, double upper) {
        lost.insert(lost.end(), {level, (std::int64_t)s.reason + place, f, node});
        numbers.insert(numbers.end(), {value, lower, upper});
      };
      next.clear();
      for (std::int64_t node : nodes) {
        if ((int)s.kind == BRANCH) {
          for (std::int64_t child = node << 1, last = child + 1; child <= last; ++child) {
            const int column = column_of(level, level, child), kind = states[column];
            if (kind == 0) next.push_back(child);
            else lose(child, kind - 1, shortfall[column], -INFINITY, kind == 1 ? 0.0 : INFINITY);
          }
          continue;
        }
        int key = 0;
        for (int joint : ask.support) key = key << 1 | (node >> (level - joint) & 1);
        Verdict& found = ask.known[key];
        if (found.frame != f) {
          for (double& one : x[END[(int)s.limb]]) one = NAN;  // a step may read the upper segment alone
          for (int joint : ask.reads) std::memcpy(x[joint], positions[column_of(joint, level, node)], sizeof x[joint]);
          found = judged(s, L, x), found.frame = f;
        }
        if (found.place == PASSED) next.push_back(node);
        else lose(node, found.place, found.value, found.lower, found.upper);
      }
      std::swap(nodes, next);
    }
    for (std::int64_t node : nodes) left_frame.push_back(f), left_code.push_back(node);
  }
  auto longs = [](const std::vector<std::int64_t>& one) { return Longs((py::ssize_t)one.size(), one.data()); };
  return py::make_tuple(longs(left_frame), longs(left_code), longs(lost), Doubles(numbers.size(), numbers.data()));
}

}  // namespace

PYBIND11_MODULE(_compiled, m) { m.def("grow", &grow); }
