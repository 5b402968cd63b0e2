// Modes of a body behind image points: Levenberg-Marquardt in joint positions, limbs eliminated onto the trunk.
// The same residuals and the same steps as posekit/solver/reference.py. Unknowns x of a posture: 14 joints, then the
// logarithm of the size that all lengths share. Parts: bit 0 the trunk (six joints and the size), bits 1 to 4 limbs.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <vector>

#include "limits.hpp"

namespace py = pybind11;

namespace {

constexpr int D = 17, TRUNK = 6, T = 19, N = 43, SIZE = 42;
constexpr int A[D] = {0, 0, 0, 3, 3, 1, 2, 6, 7, 4, 5, 10, 11, 1, 1, 2, 4};
constexpr int B[D] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 2, 3, 3, 5};
constexpr int LIMB_OF[J] = {-1, -1, -1, -1, -1, -1, 0, 1, 0, 1, 2, 3, 2, 3};
constexpr double ANGLE_STEP = 1e-4, LEAST_SINE = 0.02;
constexpr double FLOOR = 1e-6;  // added to every diagonal element, in 1/m^2: an unseen joint has none of its own
// As in reference.py.
constexpr double PRECISION = 1e-2, LEAST_DAMPING = 1, ARRIVED_DAMPING = 3e3, MOST_DAMPING = 1e6;
constexpr std::ptrdiff_t ROWS_AT_ONCE = 16, ROWS_A_THREAD = 500;

// As the dtype PROBLEM of problem.py; all fields are doubles.
struct Problem {
  double ray[J][2], image[J][2][2], root[3], root_weight[3][3], log_length[D], length_weight[D];
  double size_weight, limit_weight, perspective, robust;
};

// Normal equations, and residuals of violated limits: three rows of the pelvis, and four of each limb.
constexpr int ROWS = 19;
struct Normal {
  double H[N][N], g[N], r[ROWS], d[ROWS][N];
};

// Residuals (radians, without the deviation) of a limb's four angles g in one Euler branch; returns their sum of
// squares.
double limb_residual(const Limits& L, int limb, const double g[4], const Reading& reading, int way, double out[4]) {
  const Written w = written(L, limb, g, reading, way, 0);
  const bool arm = limb < 2 && L.by_elevation > 0;
  double total = 0;
  for (int i = 0; i < 4; ++i) {
    double above = w.value[i] - w.bound[1][i], below = w.bound[0][i] - w.value[i];
    double o = above > 0 && above >= below ? above : below > 0 ? -below : 0.0;
    if (o != 0 && (i == 2 || (i == 0 && !arm))) o *= (i == 2 ? std::sin(g[3]) : std::cos(g[1])) / std::sqrt(1 + o * o);
    out[i] = o;
    total += o * o;
  }
  return total;
}

// The Euler branch with the smallest violation, the usual branch first; its residuals are in `out`.
int least_writing(const Limits& L, int limb, const double g[4], const Reading& reading, double out[4], double& best) {
  const int ways = limb < 2 && L.by_elevation > 0 ? 2 : 4;
  int which = 0;
  best = INFINITY;
  for (int k = 0; k < ways && best > 0; ++k) {
    const int way = k ^ (limb < 2);
    double r[4], total = limb_residual(L, limb, g, reading, way, r);
    if (total < best) best = total, which = way, std::memcpy(out, r, sizeof r);
  }
  return which;
}

// Adds one residual and its derivative by the unknowns.
void add_row(Normal& n, const double d[N], double r) {
  for (int i = 0; i < N; ++i)
    if (d[i] != 0) {
      n.g[i] += d[i] * r;
      for (int k = 0; k < N; ++k) n.H[i][k] += d[i] * d[k];
    }
}
void add_limit(Normal& n, int row, const double d[N], double r) {
  n.r[row] = r;
  std::memcpy(n.d[row], d, sizeof n.d[row]);
  add_row(n, d, r);
}
void put(double t[N], int joint, Vec v, double sign) {
  t[3 * joint] += sign * v.x, t[3 * joint + 1] += sign * v.y, t[3 * joint + 2] += sign * v.z;
}
// Adds the derivative of w times the rotation vector of torso or hips.
void put_turn(double t[N], const Frame& R, bool between, Vec w) {
  Vec first, other;
  R.pull(w, first, other);
  if (R.by_down) put(t, 3, first, 1), put(t, 0, first, -1), put(t, 2, other, 1), put(t, 1, other, -1);
  else {
    put(t, 5, first, 1), put(t, 4, first, -1);
    if (between) put(t, 3, other, 1), put(t, 0, other, -1);
    else put(t, 4, other, 1), put(t, 3, other, -1);
  }
}

double limit_terms(const Problem& p, const Limits& L, const double x[J][3], unsigned parts, Normal* n) {
  const double scale = p.limit_weight;
  const bool trunk = parts & 1, between = L.between_hips > 0;
  const Frame torso = torso_of(x), hips = hips_of(x, between);
  double chi2 = 0;
  if (trunk) {
    const auto [g, py, h, axis] = pelvis_of(torso, hips);
    double cosine = std::max(h, 0.05), square = cosine * cosine;
    Vec along[3] = {(1 / square) * (torso.left + py * hips.up), axis, (1 / square) * (hips.up + py * torso.left)};
    for (int k = 0; k < 3; ++k) {
      double lo = L.pelvis[k][0], hi = L.pelvis[k][1], v = turned(PELVIS_SIGN[k] * g[k], (lo + hi) / 2);
      double r = scale * (v - std::min(std::max(v, lo), hi));
      chi2 += r * r;
      if (n && r != 0) {
        double t[N] = {};
        Vec w = (scale * PELVIS_SIGN[k]) * along[k];
        put_turn(t, hips, between, w);
        put_turn(t, torso, between, -1.0 * w);
        add_limit(*n, k, t, r);
      }
    }
  }
  for (int m = 0; m < 4; ++m) {
    if (!(parts >> (m + 1) & 1)) continue;
    const Frame& R = m < 2 ? torso : hips;
    const Limb s = limb_of(x, m, R);
    double r[4], total;
    const Reading reading = reading_of(m, s.g);
    int way = least_writing(L, m, s.g, reading, r, total);
    chi2 += scale * scale * total;
    if (!n || total == 0) continue;
    double slope[4][4];  // of each residual by each angle
    for (int i = 0; i < 4; ++i) {
      double g[4] = {s.g[0], s.g[1], s.g[2], s.g[3]}, moved[4];
      g[i] += ANGLE_STEP;
      limb_residual(L, m, g, i < 2 ? reading_of(m, g) : reading, way, moved);
      for (int k = 0; k < 4; ++k) slope[k][i] = (moved[k] - r[k]) / ANGLE_STEP;
    }
    double cg = std::cos(s.g[2]), sg = std::sin(s.g[2]), ce = std::cos(s.g[3]), se = std::sin(s.g[3]);
    double ib = 1 / std::max(s.cb, LEAST_SINE), ie = 1 / std::max(se, LEAST_SINE);
    Vec f = -sg * s.a - cg * s.b, e = (ce * cg) * s.a - (ce * sg) * s.b - se * s.u;
    for (int k = 0; k < 4; ++k) {
      if (r[k] == 0) continue;
      // Coefficients along the tangents a, b (upper), f, e (lower), and the parent's turn.
      double on_c = slope[k][2] * ie, on_e = slope[k][3];
      double on_a = (slope[k][0] + on_c * (s.cb * ce * sg + s.sb * se) - on_e * s.cb * cg) * ib;
      double on_b = slope[k][1] + on_c * ce * cg + on_e * sg;
      Vec du = (scale / s.upper) * (on_a * s.a + on_b * s.b), dl = (scale / s.lower) * (on_c * f + on_e * e);
      Vec w = scale * (on_b * s.a - on_a * s.b + on_e * f - on_c * e);
      double t[N] = {};
      put(t, MID[m], du - dl, 1), put(t, END[m], dl, 1);
      if (trunk) put(t, START[m], du, -1), put_turn(t, R, between, w);
      add_limit(*n, 3 + 4 * m + k, t, scale * r[k]);
    }
    // Curvature of the residual of an almost straight joint that bends too far; compare `bend` of a length.
    const double bent = std::max(r[3] * slope[3][3] * ce, 0.0) * ie;
    if (bent > 0) {
      double t[N] = {};
      const Vec turn = (scale * std::sqrt(bent)) * f, du = (1 / s.upper) * turn, dl = (1 / s.lower) * turn;
      put(t, MID[m], du + dl, -1), put(t, END[m], dl, 1);
      if (trunk) put(t, START[m], du, 1);
      add_row(*n, t, 0);
    }
  }
  return chi2;
}

bool freed(int joint, unsigned parts) { return parts >> (LIMB_OF[joint] + 1) & 1; }

// Returns the sum of squares at x, and the normal equations in `n` unless it is null.
double evaluate(const Problem& p, const Limits* limits, const double* at, unsigned parts, Normal* n) {
  const double(*x)[3] = reinterpret_cast<const double(*)[3]>(at);
  const double size = at[42];
  const bool trunk = parts & 1, sized = trunk && p.size_weight > 0;
  if (n) std::memset(n, 0, offsetof(Normal, d));
  double chi2 = 0;
  for (int j = 0; j < J; ++j) {
    const double(*w)[2] = p.image[j];
    if (!freed(j, parts) || (w[0][0] == 0 && w[1][1] == 0)) continue;
    double iz = 1, u = x[j][0], v = x[j][1];
    if (p.perspective > 0) {
      if (!(x[j][2] > 0)) return INFINITY;
      iz = 1 / x[j][2], u *= iz, v *= iz;
    }
    double du = u - p.ray[j][0], dv = v - p.ray[j][1], r[2], d[2][3], e = 0;
    for (int i = 0; i < 2; ++i) {
      r[i] = w[i][0] * du + w[i][1] * dv, e += r[i] * r[i];
      d[i][0] = w[i][0] * iz, d[i][1] = w[i][1] * iz;
      d[i][2] = p.perspective > 0 ? -(w[i][0] * u + w[i][1] * v) * iz : 0.0;
    }
    const double keep = 1 / (1 + p.robust * e);
    const double g = keep * keep;
    e *= keep;
    chi2 += e;
    if (n)
      for (int i = 0; i < 3; ++i) {
        n->g[3 * j + i] += g * (d[0][i] * r[0] + d[1][i] * r[1]);
        for (int k = 0; k < 3; ++k) n->H[3 * j + i][3 * j + k] += g * (d[0][i] * d[0][k] + d[1][i] * d[1][k]);
      }
  }
  if (trunk) {
    for (int k = 0; k < 3; ++k) {
      double r = 0;
      for (int i = 0; i < 3; ++i) r += p.root_weight[k][i] * (x[0][i] - p.root[i]);
      chi2 += r * r;
      if (n)
        for (int i = 0; i < 3; ++i) {
          n->g[i] += p.root_weight[k][i] * r;
          for (int j = 0; j < 3; ++j) n->H[i][j] += p.root_weight[k][i] * p.root_weight[k][j];
        }
    }
    chi2 += p.size_weight * p.size_weight * size * size;
    if (n) {
      n->H[SIZE][SIZE] = sized ? p.size_weight * p.size_weight : 1;  // the diagonal element of a fixed size is one
      n->g[SIZE] = p.size_weight * p.size_weight * size;
    }
  }
  for (int s = 0; s < D; ++s) {
    const int a = A[s], b = B[s];
    if (!freed(b, parts)) continue;
    double e[3], h[3][3], q = 0, w = p.length_weight[s];
    for (int i = 0; i < 3; ++i) e[i] = x[b][i] - x[a][i], q += e[i] * e[i];
    double r = w * (0.5 * std::log(q) - p.log_length[s] - size);
    chi2 += r * r;
    if (!n) continue;
    double t = w / q, bend = std::max(w * r, 0.0) / q;  // curvature of the length, if positive
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) h[i][k] = t * t * e[i] * e[k] + bend * ((i == k) - e[i] * e[k] / q);
    const double along = sized ? w : 0;
    for (int one : {b, a}) {
      const double sign = one == b ? 1 : -1;
      if (!freed(one, parts)) continue;
      for (int i = 0; i < 3; ++i) {
        n->g[3 * one + i] += sign * t * e[i] * r;
        n->H[3 * one + i][SIZE] -= sign * along * t * e[i], n->H[SIZE][3 * one + i] -= sign * along * t * e[i];
        for (int other : {b, a})
          if (freed(other, parts))
            for (int k = 0; k < 3; ++k) n->H[3 * one + i][3 * other + k] += (one == other ? 1 : -1) * h[i][k];
      }
    }
    n->H[SIZE][SIZE] += along * along, n->g[SIZE] -= along * r;
  }
  return limits && p.limit_weight > 0 ? chi2 + limit_terms(p, *limits, x, parts, n) : chi2;
}

// M = U'U: the upper triangle becomes U, row by row, so that the inner loops run along rows.
template <int K>
void cholesky(double M[K][K]) {
  for (int k = 0; k < K; ++k) {
    const double f = 1 / std::sqrt(M[k][k]);
    for (int j = k; j < K; ++j) M[k][j] *= f;
    for (int i = k + 1; i < K; ++i) {
      const double c = M[k][i];
      for (int j = i; j < K; ++j) M[i][j] -= c * M[k][j];
    }
  }
}

// Unknowns of the trunk and of each limb.
constexpr int TRUNK_AT[T] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, SIZE};
inline int limb_at(int m, int i) { return 3 * (i < 3 ? MID[m] : END[m]) + i % 3; }

// Cholesky factors of the damped matrix: of each limb's block, of the coupling of limb and trunk (multiplied by the
// inverse of the limb's factor), and of the trunk's block after the elimination of the limbs.
struct Factor {
  double L[4][6][6], C[4][6][T], S[T][T];
  int used[4][T], count[4] = {};  // a limb within its limits depends on three coordinates of the trunk, and the size
  unsigned parts;

  Factor(const Normal& n, double damping, unsigned which) : parts(which) {
    for (int i = 0; i < T && parts & 1; ++i) {
      for (int k = 0; k < T; ++k) S[i][k] = n.H[TRUNK_AT[i]][TRUNK_AT[k]];
      S[i][i] += damping + FLOOR;
    }
    for (int m = 0; m < 4; ++m) {
      if (!(parts >> (m + 1) & 1)) continue;
      for (int i = 0; i < 6; ++i) {
        const double* row = n.H[limb_at(m, i)];
        for (int k = 0; k < 6; ++k) L[m][i][k] = row[limb_at(m, k)];
        for (int c = 0; c < T; ++c) C[m][i][c] = row[TRUNK_AT[c]];
        L[m][i][i] += damping + FLOOR;
      }
      cholesky<6>(L[m]);
      if (!(parts & 1)) continue;
      for (int c = 0; c < T; ++c)
        if (std::any_of(C[m], C[m] + 6, [&](const double* row) { return row[c] != 0; })) used[m][count[m]++] = c;
      for (int a = 0; a < count[m]; ++a) {
        const int c = used[m][a];
        for (int i = 0; i < 6; ++i) {
          for (int k = 0; k < i; ++k) C[m][i][c] -= L[m][k][i] * C[m][k][c];
          C[m][i][c] /= L[m][i][i];
        }
        for (int b = 0; b <= a; ++b)
          for (int k = 0; k < 6; ++k) S[used[m][b]][c] -= C[m][k][used[m][b]] * C[m][k][c];
      }
    }
    if (parts & 1) cholesky<T>(S);
  }

  // The steps x (N, K) for K gradients g.
  template <int K>
  void solve(const double g[N][K], double x[N][K]) const {
    double t[T][K], l[4][6][K];
    auto less = [](double* to, double times, const double* from) {
      for (int k = 0; k < K; ++k) to[k] -= times * from[k];
    };
    auto divided = [](const double* from, double by, double* to) {
      for (int k = 0; k < K; ++k) to[k] = from[k] / by;
    };
    for (int i = 0; i < T; ++i) divided(g[TRUNK_AT[i]], -1, t[i]);
    for (int m = 0; m < 4; ++m) {
      if (!(parts >> (m + 1) & 1)) continue;
      for (int i = 0; i < 6; ++i) {
        divided(g[limb_at(m, i)], -1, l[m][i]);
        for (int k = 0; k < i; ++k) less(l[m][i], L[m][k][i], l[m][k]);
        divided(l[m][i], L[m][i][i], l[m][i]);
        for (int c = 0; c < count[m]; ++c) less(t[used[m][c]], C[m][i][used[m][c]], l[m][i]);
      }
    }
    if (parts & 1) {
      for (int i = 0; i < T; ++i) {
        divided(t[i], S[i][i], t[i]);
        for (int k = i + 1; k < T; ++k) less(t[k], S[i][k], t[i]);
      }
      for (int i = T - 1; i >= 0; --i) {
        for (int k = i + 1; k < T; ++k) less(t[i], S[i][k], t[k]);
        divided(t[i], S[i][i], t[i]);
        std::memcpy(x[TRUNK_AT[i]], t[i], sizeof t[i]);
      }
    }
    for (int m = 0; m < 4; ++m) {
      if (!(parts >> (m + 1) & 1)) continue;
      for (int i = 5; i >= 0; --i) {
        for (int c = 0; c < count[m]; ++c) less(l[m][i], C[m][i][used[m][c]], t[used[m][c]]);
        for (int k = i + 1; k < 6; ++k) less(l[m][i], L[m][i][k], l[m][k]);
        divided(l[m][i], L[m][i][i], l[m][i]);
        std::memcpy(x[limb_at(m, i)], l[m][i], sizeof l[m][i]);
      }
    }
  }
};

// Levenberg-Marquardt; returns chi2. Limits that a refused step violates, but not its start, are added to the model of
// the next step. At return, `damping` is infinite if x has converged or is abandoned.
double descend(const Problem& p, const Limits* L, double* x, unsigned parts, int most, double hopeless,
               double& damping) {
  Normal three[3], *here = three, *there = three + 1, *ahead = three + 2;
  double chi2 = evaluate(p, L, x, parts, std::isfinite(damping) ? here : nullptr), dx[N] = {}, y[N];
  bool refused = false;
  for (int steps = 0; steps < most && std::isfinite(chi2 + damping); ++steps) {
    const Normal& model = refused ? *ahead : *here;
    const Factor factor(model, damping, parts);
    factor.solve<1>(reinterpret_cast<const double(*)[1]>(model.g), reinterpret_cast<double(*)[1]>(dx));
    double gain = 0;
    for (int i = 0; i < N; ++i) gain += dx[i] * ((damping + FLOOR) * dx[i] - model.g[i]);
    if ((gain <= PRECISION && damping <= ARRIVED_DAMPING) || damping > MOST_DAMPING ||
        (chi2 > hopeless && gain < 0.5 * chi2)) {
      damping = INFINITY;
      break;
    }
    for (int i = 0; i < N; ++i) y[i] = x[i] + dx[i];
    const double value = evaluate(p, L, y, parts, there);
    if (value <= chi2) {
      const double ratio = (chi2 - value) / gain;
      damping = std::max(damping * (ratio > 0.75 ? 0.2 : ratio < 0.25 ? 4 : 1), LEAST_DAMPING);
      std::memcpy(x, y, sizeof y);
      std::swap(here, there);
      chi2 = value, refused = false;
      continue;
    }
    *ahead = *here;
    bool met = false;
    for (int k = 0; k < ROWS && std::isfinite(value); ++k)
      if (there->r[k] != 0 && here->r[k] == 0) {
        double r = there->r[k];
        for (int i = 0; i < N; ++i) r -= there->d[k][i] * dx[i];
        add_row(*ahead, there->d[k], r * there->r[k] > 0 ? 0 : r);
        met = true;
      }
    if (refused || !met) damping *= 16;
    refused = true;
  }
  return chi2;
}

// Adds the information of priors: on the position of every joint, on hidden joints about their modes, and on rotations
// of segments nearly perpendicular to their rays (see modes.py).
void inform(Normal& n, const Problem& p, const double* at, unsigned parts, const double known[3]) {
  const double(*x)[3] = reinterpret_cast<const double(*)[3]>(at);
  for (int j = 0; j < J; ++j)
    for (int i = 3 * j; i < 3 * j + 3; ++i) n.H[i][i] += known[p.image[j][0][0] == 0 && p.image[j][1][1] == 0];
  for (int m = 0; m < 4; ++m)
    for (int lower = 0; lower < 2 && parts >> (m + 1) & 1; ++lower) {
      int a = lower ? MID[m] : START[m], b = lower ? END[m] : MID[m];
      Vec line = vec(x[b]) - vec(x[a]), ray = p.perspective > 0 ? vec(x[b]) : Vec{0, 0, 1};
      double square = dot(line, line), weight = 0;
      for (int i = 0; i < 4; ++i) weight += p.image[b][i / 2][i % 2] * p.image[b][i / 2][i % 2] / 2;
      Vec turn = ray - (dot(ray, line) / square) * line;
      double size = norm(turn), depth = p.perspective > 0 ? std::fabs(x[b][2]) : 1.0;
      if (!(size > 0)) continue;
      double info = known[2] * std::sqrt(weight / square) * size / norm(ray) / depth;
      double t[3] = {turn.x / size, turn.y / size, turn.z / size};
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) {
          double h = info * t[i] * t[k];
          n.H[3 * b + i][3 * b + k] += h, n.H[3 * a + i][3 * a + k] += h;
          n.H[3 * a + i][3 * b + k] -= h, n.H[3 * b + i][3 * a + k] -= h;
        }
    }
}

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Longs = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

const Problem* problems_of(const py::array& problems) {
  if (problems.itemsize() != (py::ssize_t)sizeof(Problem)) throw std::invalid_argument("records of another layout");
  return static_cast<const Problem*>(problems.data());
}
const Limits* limits_of(const py::object& limits) {
  if (limits.is_none()) return nullptr;
  py::array array = py::cast<py::array>(limits);
  if (array.itemsize() != (py::ssize_t)sizeof(Limits)) throw std::invalid_argument("limits of another layout");
  return static_cast<const Limits*>(array.data());
}

py::tuple descend_all(py::array problems, py::object limits, Longs which, Doubles start, unsigned parts, int most,
                      Doubles hopeless, Doubles damped) {
  const Problem* p = problems_of(problems);
  const Limits* L = limits_of(limits);
  const py::ssize_t count = which.size();
  py::array_t<double> x({count, (py::ssize_t)N}), chi2(count), damping(count);
  std::memcpy(x.mutable_data(), start.data(), sizeof(double) * N * count);
  std::memcpy(damping.mutable_data(), damped.data(), sizeof(double) * count);
  double *at = x.mutable_data(), *value = chi2.mutable_data(), *damp = damping.mutable_data();
  const std::int64_t* row = which.data();
  const double* limit = hopeless.data();
  {
    py::gil_scoped_release released;
    std::atomic<py::ssize_t> next{0};
    auto work = [&] {
      for (py::ssize_t first; (first = next.fetch_add(ROWS_AT_ONCE)) < count;)
        for (py::ssize_t k = first; k < std::min(first + ROWS_AT_ONCE, count); ++k)
          value[k] = descend(p[row[k]], L, at + k * N, parts, most, limit[k], damp[k]);
    };
    std::vector<std::thread> others;
    const py::ssize_t wanted = std::min<py::ssize_t>(std::thread::hardware_concurrency(), count / ROWS_A_THREAD);
    for (py::ssize_t k = 1; k < wanted; ++k) others.emplace_back(work);
    work();
    for (auto& one : others) one.join();
  }
  return py::make_tuple(x, chi2, damping);
}

// Calls `take` with the information matrix of each body.
template <typename Take>
void informed(const py::array& problems, const py::object& limits, const Longs& which, const Doubles& at,
              const Doubles& known, Take take) {
  const Problem* p = problems_of(problems);
  const Limits* L = limits_of(limits);
  Normal n;
  for (py::ssize_t k = 0; k < which.size(); ++k) {
    const double* x = at.data() + k * N;
    evaluate(p[which.data()[k]], L, x, 31, &n);
    inform(n, p[which.data()[k]], x, 31, known.data());
    take(k, n);
  }
}

// Covariances of the joints (M, 42, 42).
py::array_t<double> covariance(py::array problems, py::object limits, Longs which, Doubles at, Doubles known) {
  py::array_t<double> found({which.size(), (py::ssize_t)SIZE, (py::ssize_t)SIZE});
  informed(problems, limits, which, at, known, [&](py::ssize_t k, const Normal& n) {
    const Factor factor(n, 0, 31);
    double units[N][SIZE] = {}, inverse[N][SIZE];
    for (int i = 0; i < SIZE; ++i) units[i][i] = -1;
    factor.solve<SIZE>(units, inverse);
    std::memcpy(found.mutable_data(k), inverse, sizeof(double) * SIZE * SIZE);
  });
  return found;
}

// Logarithms of the determinants (M,); NaN if a determinant is not positive.
py::array_t<double> log_determinants(py::array problems, py::object limits, Longs which, Doubles at, Doubles known) {
  py::array_t<double> found(which.size());
  informed(problems, limits, which, at, known, [&](py::ssize_t k, Normal& n) {
    const Factor factor(n, 0, 31);
    double total = 0;
    for (int c = 0; c < T; ++c) total += 2 * std::log(factor.S[c][c]);
    for (int m = 0; m < 4; ++m)
      for (int c = 0; c < 6; ++c) total += 2 * std::log(factor.L[m][c][c]);
    found.mutable_data()[k] = total;
  });
  return found;
}

// Whether each body differs from every kept body of lower chi2 in its group: see modes.py.
py::array_t<bool> distinct(py::array problems, py::object limits, Longs group, Longs which, Doubles at, unsigned parts,
                           Doubles within, double reach, double level, Doubles known) {
  const Problem* p = problems_of(problems);
  const Limits* L = limits_of(limits);
  const py::ssize_t count = which.size();
  py::array_t<bool> keep(count);
  std::vector<std::vector<double>> matrices;
  std::vector<py::ssize_t> kept;
  Normal n;
  for (py::ssize_t k = 0; k < count; ++k) {
    const double *a = at.data() + k * N, near = within.data()[k], most = std::max(near, reach);
    if (k && group.data()[k] != group.data()[k - 1]) kept.clear(), matrices.clear();
    bool same = false;
    for (size_t i = 0; i < kept.size() && !same; ++i) {
      const double* b = at.data() + kept[i] * N;
      double d[N], far = 0;
      for (int j = 0; j < N; ++j) d[j] = a[j] - b[j];
      for (int j = 0; j < J && far < most * most; ++j)
        if (freed(j, parts)) {
          const Vec apart = vec(d + 3 * j) - vec(d);
          far = std::max(far, dot(apart, apart));
        }
      same = far < near * near;
      if (same || far >= reach * reach) continue;
      if (matrices[i].empty()) {
        evaluate(p[which.data()[k]], L, b, parts, &n);
        inform(n, p[which.data()[k]], b, parts, known.data());
        matrices[i].assign(n.H[0], n.H[0] + N * N);
      }
      double total = 0;
      for (int j = 0; j < N; ++j)
        for (int c = 0; c < N; ++c) total += matrices[i][j * N + c] * d[c] * d[j];
      same = total < level;
    }
    keep.mutable_data()[k] = !same;
    if (!same) kept.push_back(k), matrices.emplace_back();
  }
  return keep;
}

// Value, lower and upper bound and tolerance (4, M, 4) of one limb of bodies (M, 14, 3), degrees.
py::array_t<double> stated_all(py::object limits, int limb, Doubles bodies, double tolerance, double straight) {
  const Limits& L = *limits_of(limits);
  const py::ssize_t count = bodies.shape(0);
  py::array_t<double> out({(py::ssize_t)4, count, (py::ssize_t)4});
  for (py::ssize_t k = 0; k < count; ++k) {
    const double(*x)[3] = reinterpret_cast<const double(*)[3]>(bodies.data() + k * J * 3);
    const Frame R = limb < 2 ? torso_of(x) : hips_of(x, L.between_hips > 0);
    const Stated one = stated(L, limb, limb_of(x, limb, R).g, tolerance, straight);
    for (int i = 0; i < 16; ++i) out.mutable_data()[(i / 4 * count + k) * 4 + i % 4] = one.row[i / 4][i % 4];
  }
  return out;
}

}  // namespace

PYBIND11_MODULE(_compiled, m) {
  m.def("descend", &descend_all);
  m.def("covariance", &covariance);
  m.def("log_determinants", &log_determinants);
  m.def("distinct", &distinct);
  m.def("stated", &stated_all);
}
