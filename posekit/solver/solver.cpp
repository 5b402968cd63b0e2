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

constexpr int D = 17, TRUNK = 6, T = 19, N = 43, SIZE = 18;
constexpr int A[D] = {0, 0, 0, 3, 3, 1, 2, 6, 7, 4, 5, 10, 11, 1, 1, 2, 4};
constexpr int B[D] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 2, 3, 3, 5};
constexpr int LIMB_OF[J] = {-1, -1, -1, -1, -1, -1, 0, 1, 0, 1, 2, 3, 2, 3};
constexpr int ROW_OF[J] = {0, 3, 6, 9, 12, 15, 0, 0, 3, 3, 0, 0, 3, 3};
constexpr double ANGLE_STEP = 1e-4, LEAST_SINE = 0.02;
constexpr double FLOOR = 1e-6;  // added to every diagonal element, in 1/m^2: an unseen joint has none of its own
constexpr std::ptrdiff_t ROWS_AT_ONCE = 16, ROWS_A_THREAD = 500;

// As the dtype PROBLEM of problem.py; all fields are doubles.
struct Problem {
  double ray[J][2], image[J][2][2], root[3], root_weight[3][3], log_length[D], length_weight[D];
  double size_weight, limit_weight, perspective, robust;
};

struct Normal {
  double H[T][T], g[T], L[4][6][6], C[4][6][T], l[4][6];
};

// Residuals (radians, without the deviation) of a limb's four angles g in one writing; returns their sum of squares.
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

// The least violated writing; residuals are in `out`.
int least_writing(const Limits& L, int limb, const double g[4], const Reading& reading, double out[4], double& best) {
  const int ways = limb < 2 && L.by_elevation > 0 ? 2 : 4;
  int which = 0;
  best = INFINITY;
  for (int way = 0; way < ways && best > 0; ++way) {
    double r[4], total = limb_residual(L, limb, g, reading, way, r);
    if (total < best) best = total, which = way, std::memcpy(out, r, sizeof r);
  }
  return which;
}

// Adds one residual with its derivative along the trunk (18) and one limb (6).
void add_row(Normal& n, int m, const double t[18], const double* d, double r, bool trunk) {
  if (trunk)
    for (int i = 0; i < 18; ++i)
      if (t[i] != 0) {
        n.g[i] += t[i] * r;
        for (int k = 0; k < 18; ++k) n.H[i][k] += t[i] * t[k];
      }
  if (!d) return;
  for (int i = 0; i < 6; ++i) {
    n.l[m][i] += d[i] * r;
    for (int k = 0; k < 6; ++k) n.L[m][i][k] += d[i] * d[k];
    if (trunk)
      for (int k = 0; k < 18; ++k) n.C[m][i][k] += d[i] * t[k];
  }
}
void put(double t[18], int joint, Vec v, double sign) {
  t[3 * joint] += sign * v.x, t[3 * joint + 1] += sign * v.y, t[3 * joint + 2] += sign * v.z;
}
// Derivative of a part's turn, weighted with w, along the trunk.
void put_turn(double t[18], const Frame& R, bool between, Vec w) {
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
        double t[18] = {};
        Vec w = (scale * PELVIS_SIGN[k]) * along[k];
        put_turn(t, hips, between, w);
        put_turn(t, torso, between, -1.0 * w);
        add_row(*n, 0, t, nullptr, r, true);
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
    double slope[4][4];  // of each residual along each angle
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
      double t[18] = {}, d[6] = {du.x - dl.x, du.y - dl.y, du.z - dl.z, dl.x, dl.y, dl.z};
      if (trunk) put(t, START[m], du, -1), put_turn(t, R, between, w);
      add_row(*n, m, t, d, scale * r[k], trunk);
    }
  }
  return chi2;
}

// Sum of squares at x; with `n` the normal equations.
double evaluate(const Problem& p, const Limits* limits, const double* at, unsigned parts, Normal* n) {
  const double(*x)[3] = reinterpret_cast<const double(*)[3]>(at);
  const double size = at[42];
  const bool trunk = parts & 1, sized = trunk && p.size_weight > 0;
  auto free_ = [&](int j) { return j < TRUNK ? trunk : bool(parts >> (LIMB_OF[j] + 1) & 1); };
  auto block = [&](int j, int i, int k) -> double& {
    return j < TRUNK ? n->H[3 * j + i][3 * j + k] : n->L[LIMB_OF[j]][ROW_OF[j] + i][ROW_OF[j] + k];
  };
  auto slope = [&](int j, int i) -> double& { return j < TRUNK ? n->g[3 * j + i] : n->l[LIMB_OF[j]][ROW_OF[j] + i]; };
  if (n) std::memset(n, 0, sizeof *n);
  double chi2 = 0;
  for (int j = 0; j < J; ++j) {
    const double(*w)[2] = p.image[j];
    if (!free_(j) || (w[0][0] == 0 && w[1][1] == 0)) continue;
    double iz = 1, u = x[j][0], v = x[j][1];
    if (p.perspective > 0) {
      if (!(x[j][2] > 0)) return INFINITY;
      iz = 1 / x[j][2], u *= iz, v *= iz;
    }
    double du = u - p.ray[j][0], dv = v - p.ray[j][1], r[2], d[2][3], e = 0, g = 1;
    for (int i = 0; i < 2; ++i) {
      r[i] = w[i][0] * du + w[i][1] * dv, e += r[i] * r[i];
      d[i][0] = w[i][0] * iz, d[i][1] = w[i][1] * iz;
      d[i][2] = p.perspective > 0 ? -(w[i][0] * u + w[i][1] * v) * iz : 0.0;
    }
    if (p.robust > 0) g = p.robust / (p.robust + e), e *= g, g *= g;
    chi2 += e;
    if (n)
      for (int i = 0; i < 3; ++i) {
        slope(j, i) += g * (d[0][i] * r[0] + d[1][i] * r[1]);
        for (int k = 0; k < 3; ++k) block(j, i, k) += g * (d[0][i] * d[0][k] + d[1][i] * d[1][k]);
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
      n->H[SIZE][SIZE] = sized ? p.size_weight * p.size_weight : 1;  // a size that is not varied keeps a unit
      n->g[SIZE] = p.size_weight * p.size_weight * size;
    }
  }
  for (int s = 0; s < D; ++s) {
    int a = A[s], b = B[s], m = LIMB_OF[b];
    bool fa = free_(a);
    if (!free_(b)) continue;
    double e[3], q = 0, w = p.length_weight[s];
    for (int i = 0; i < 3; ++i) e[i] = x[b][i] - x[a][i], q += e[i] * e[i];
    double r = w * (0.5 * std::log(q) - p.log_length[s] - size);
    chi2 += r * r;
    if (!n) continue;
    double t = w / q, bend = std::max(w * r, 0.0) / q;  // curvature of a segment that turns, where it is positive
    for (int i = 0; i < 3; ++i) {
      slope(b, i) += t * e[i] * r;
      if (fa) slope(a, i) -= t * e[i] * r;
      for (int k = 0; k < 3; ++k) {
        double h = t * t * e[i] * e[k] + bend * ((i == k) - e[i] * e[k] / q);
        block(b, i, k) += h;
        if (!fa) continue;
        block(a, i, k) += h;
        if (m < 0) n->H[3 * a + i][3 * b + k] -= h, n->H[3 * b + i][3 * a + k] -= h;
        else if (a < TRUNK) n->C[m][i][3 * a + k] -= h;
        else n->L[m][i][3 + k] -= h, n->L[m][3 + i][k] -= h;
      }
      if (!sized) continue;
      double c = w * t * e[i];
      if (m < 0) n->H[3 * b + i][SIZE] -= c, n->H[SIZE][3 * b + i] -= c;
      else n->C[m][ROW_OF[b] + i][SIZE] -= c;
      if (a < TRUNK) n->H[3 * a + i][SIZE] += c, n->H[SIZE][3 * a + i] += c;
      else n->C[m][ROW_OF[a] + i][SIZE] += c;
    }
    if (sized) n->H[SIZE][SIZE] += w * w, n->g[SIZE] -= w * r;
  }
  return limits && p.limit_weight > 0 ? chi2 + limit_terms(p, *limits, x, parts, n) : chi2;
}

// M = U'U: the upper triangle becomes U, row by row, so that the inner loops run along rows.
template <int K>
bool cholesky(double M[K][K]) {
  for (int k = 0; k < K; ++k) {
    if (!(M[k][k] > 0)) return false;
    const double f = 1 / std::sqrt(M[k][k]);
    for (int j = k; j < K; ++j) M[k][j] *= f;
    for (int i = k + 1; i < K; ++i) {
      const double c = M[k][i];
      for (int j = i; j < K; ++j) M[i][j] -= c * M[k][j];
    }
  }
  return true;
}

// Eliminates limbs: n.L and n.H become Cholesky factors, n.C and n.l are divided by the limbs' factors.
bool eliminate(Normal& n, double damping, unsigned parts, double add_l[4][6], double add_t[T]) {
  for (int i = 0; i < T; ++i) add_t[i] = n.H[i][i] * damping + FLOOR;
  for (int m = 0; m < 4; ++m) {
    if (!(parts >> (m + 1) & 1)) continue;
    for (int i = 0; i < 6; ++i) add_l[m][i] = n.L[m][i][i] * damping + FLOOR, n.L[m][i][i] += add_l[m][i];
    if (!cholesky<6>(n.L[m])) return false;
    int used[T], count = 0;  // a limb within its limits knows three coordinates of the trunk, and the size
    for (int c = 0; c < T; ++c)
      for (int i = 0; i < 6; ++i)
        if (n.C[m][i][c] != 0) {
          used[count++] = c;
          break;
        }
    for (int i = 0; i < 6; ++i) {
      const double f = 1 / n.L[m][i][i];
      for (int k = 0; k < i; ++k) {
        n.l[m][i] -= n.L[m][k][i] * n.l[m][k];
        for (int c = 0; c < count; ++c) n.C[m][i][used[c]] -= n.L[m][k][i] * n.C[m][k][used[c]];
      }
      n.l[m][i] *= f;
      for (int c = 0; c < count; ++c) n.C[m][i][used[c]] *= f;
    }
    if (!(parts & 1)) continue;
    for (int c = 0; c < count; ++c)
      for (int k = 0; k < 6; ++k) {
        const double at = n.C[m][k][used[c]];
        n.g[used[c]] -= at * n.l[m][k];
        for (int d = c; d < count; ++d) n.H[used[c]][used[d]] -= at * n.C[m][k][used[d]];
      }
  }
  if (!(parts & 1)) return true;
  for (int i = 0; i < T; ++i) n.H[i][i] += add_t[i];
  return cholesky<T>(n.H);
}

// One damped step; returns the decrease of chi2 that the linear model promises, negative if there is none.
double step(const Normal& start, double damping, unsigned parts, double dx[N]) {
  Normal n = start;
  double add_l[4][6], add_t[T], t[T] = {}, gain = 0;
  if (!eliminate(n, damping, parts, add_l, add_t)) return -1;
  if (parts & 1) {
    for (int i = 0; i < T; ++i) {
      t[i] = n.g[i] / n.H[i][i], gain += t[i] * t[i];
      for (int k = i + 1; k < T; ++k) n.g[k] -= n.H[i][k] * t[i];
    }
    for (int i = T - 1; i >= 0; --i) {
      for (int k = i + 1; k < T; ++k) t[i] -= n.H[i][k] * t[k];
      t[i] /= n.H[i][i];
    }
    for (int i = 0; i < T; ++i) gain += add_t[i] * t[i] * t[i], dx[i < 18 ? i : 42] = -t[i];
  }
  for (int m = 0; m < 4; ++m) {
    if (!(parts >> (m + 1) & 1)) continue;
    double d[6];
    for (int i = 0; i < 6; ++i) {
      gain += n.l[m][i] * n.l[m][i], d[i] = n.l[m][i];
      if (parts & 1)
        for (int c = 0; c < T; ++c) d[i] -= n.C[m][i][c] * t[c];
    }
    for (int i = 5; i >= 0; --i) {
      for (int k = i + 1; k < 6; ++k) d[i] -= n.L[m][i][k] * d[k];
      d[i] /= n.L[m][i][i];
    }
    for (int i = 0; i < 6; ++i) gain += add_l[m][i] * d[i] * d[i], dx[3 * (i < 3 ? MID[m] : END[m]) + i % 3] = -d[i];
  }
  return gain;
}

double descend(const Problem& p, const Limits* L, double* x, unsigned parts, int most, double precision,
               double hopeless, int& steps) {
  Normal two[2], *here = two, *there = two + 1;
  double damping = 1e-4, chi2 = evaluate(p, L, x, parts, here), dx[N] = {}, y[N];
  for (; steps < most && std::isfinite(chi2); ++steps) {
    double gain = step(*here, damping, parts, dx);
    if (gain < 0) {
      damping = std::max(damping * 8, 1e-4);
      continue;
    }
    if ((gain <= precision && damping <= 0.1) || damping > 1e6 || (chi2 > hopeless && gain < 0.5 * chi2)) break;
    for (int i = 0; i < N; ++i) y[i] = x[i] + dx[i];
    double value = evaluate(p, L, y, parts, there);
    if (value <= chi2) {
      double ratio = (chi2 - value) / gain;
      damping = std::max(ratio > 0.75 ? damping * 0.1 : ratio < 0.25 ? damping * 4 : damping, 1e-12);
      std::memcpy(x, y, sizeof y);
      std::swap(here, there);
      chi2 = value;
    } else damping *= 8;
  }
  return chi2;
}

// Adds what is known besides the residuals: places at all, hidden joints about their modes, and turns of segments near
// a right angle to their rays (see modes.py).
void inform(Normal& n, const Problem& p, const double* at, const double known[3]) {
  const double(*x)[3] = reinterpret_cast<const double(*)[3]>(at);
  for (int j = 0; j < J; ++j) {
    double own = p.image[j][0][0] == 0 && p.image[j][1][1] == 0 ? known[1] : known[0];
    for (int i = 0; i < 3; ++i) {
      int at_limb = ROW_OF[j] + i;
      (j < TRUNK ? n.H[3 * j + i][3 * j + i] : n.L[LIMB_OF[j]][at_limb][at_limb]) += own;
    }
  }
  for (int m = 0; m < 4; ++m)
    for (int lower = 0; lower < 2; ++lower) {
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
          n.L[m][3 * lower + i][3 * lower + k] += h;
          if (lower) n.L[m][i][k] += h, n.L[m][i][3 + k] -= h, n.L[m][3 + i][k] -= h;
          else n.H[3 * a + i][3 * a + k] += h, n.C[m][i][3 * a + k] -= h;
        }
    }
}

// The matrix of the normal equations, dense, in the order of the unknowns.
void spread(const Normal& n, double H[N][N]) {
  int trunk[T];
  for (int i = 0; i < T; ++i) trunk[i] = i < 18 ? i : 42;
  std::memset(H, 0, sizeof(double) * N * N);
  for (int i = 0; i < T; ++i)
    for (int j = 0; j < T; ++j) H[trunk[i]][trunk[j]] = n.H[i][j];
  for (int m = 0; m < 4; ++m)
    for (int i = 0; i < 6; ++i) {
      int row = 3 * (i < 3 ? MID[m] : END[m]) + i % 3;
      for (int j = 0; j < 6; ++j) H[row][3 * (j < 3 ? MID[m] : END[m]) + j % 3] = n.L[m][i][j];
      for (int c = 0; c < T; ++c) H[row][trunk[c]] = H[trunk[c]][row] = n.C[m][i][c];
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
                      double precision, Doubles hopeless) {
  const Problem* p = problems_of(problems);
  const Limits* L = limits_of(limits);
  const py::ssize_t count = which.size();
  py::array_t<double> x({count, (py::ssize_t)N}), chi2(count);
  py::array_t<std::int64_t> steps(count);
  std::memcpy(x.mutable_data(), start.data(), sizeof(double) * N * count);
  double *at = x.mutable_data(), *value = chi2.mutable_data();
  const std::int64_t* row = which.data();
  std::int64_t* taken = steps.mutable_data();
  const double* limit = hopeless.data();
  {
    py::gil_scoped_release released;
    std::atomic<py::ssize_t> next{0};
    auto work = [&] {
      for (py::ssize_t first; (first = next.fetch_add(ROWS_AT_ONCE)) < count;)
        for (py::ssize_t k = first; k < std::min(first + ROWS_AT_ONCE, count); ++k) {
          int done = 0;
          value[k] = descend(p[row[k]], L, at + k * N, parts, most, precision, limit[k], done);
          taken[k] = done;
        }
    };
    std::vector<std::thread> others;
    const py::ssize_t wanted = std::min<py::ssize_t>(std::thread::hardware_concurrency(), count / ROWS_A_THREAD);
    for (py::ssize_t k = 1; k < wanted; ++k) others.emplace_back(work);
    work();
    for (auto& one : others) one.join();
  }
  return py::make_tuple(x, chi2, steps);
}

// Hands the information on the unknowns of each body to `take`.
template <typename Take>
void informed(const py::array& problems, const py::object& limits, const Longs& which, const Doubles& at,
              const Doubles& known, Take take) {
  const Problem* p = problems_of(problems);
  const Limits* L = limits_of(limits);
  Normal n;
  for (py::ssize_t k = 0; k < which.size(); ++k) {
    const double* x = at.data() + k * N;
    evaluate(p[which.data()[k]], L, x, 31, &n);
    inform(n, p[which.data()[k]], x, known.data());
    take(k, n);
  }
}

// As dense matrices (M, 43, 43).
py::array_t<double> information(py::array problems, py::object limits, Longs which, Doubles at, Doubles known) {
  py::array_t<double> found({which.size(), (py::ssize_t)N, (py::ssize_t)N});
  informed(problems, limits, which, at, known, [&](py::ssize_t k, const Normal& n) {
    spread(n, reinterpret_cast<double(*)[N]>(found.mutable_data() + k * N * N));
  });
  return found;
}

// Logarithms of the determinants (M,); NaN where one is not positive.
py::array_t<double> log_determinants(py::array problems, py::object limits, Longs which, Doubles at, Doubles known) {
  py::array_t<double> found(which.size());
  informed(problems, limits, which, at, known, [&](py::ssize_t k, Normal& n) {
    double add_l[4][6], add_t[T], total = eliminate(n, 0, 31, add_l, add_t) ? 0 : NAN;
    for (int c = 0; c < T; ++c) total += 2 * std::log(n.H[c][c]);
    for (int m = 0; m < 4; ++m)
      for (int c = 0; c < 6; ++c) total += 2 * std::log(n.L[m][c][c]);
    found.mutable_data()[k] = total;
  });
  return found;
}

// For bodies by frame, the best first, whether each differs from all that are kept before: see modes.py.
py::array_t<bool> separate(py::array problems, py::object limits, Longs which, Doubles at, Doubles known, double within,
                           double reach, double level) {
  const Problem* p = problems_of(problems);
  const Limits* L = limits_of(limits);
  const py::ssize_t count = which.size();
  py::array_t<bool> keep(count);
  std::vector<std::vector<double>> matrices;
  std::vector<py::ssize_t> kept;
  Normal n;
  for (py::ssize_t k = 0; k < count; ++k) {
    const double* a = at.data() + k * N;
    if (k && which.data()[k] != which.data()[k - 1]) kept.clear(), matrices.clear();
    bool same = false;
    for (size_t i = 0; i < kept.size() && !same; ++i) {
      const double* b = at.data() + kept[i] * N;
      double d[N], far = 0;
      for (int j = 0; j < N; ++j) d[j] = a[j] - b[j];
      for (int j = 3; j < 42 && far < reach * reach; j += 3) {
        Vec apart = vec(d + j) - vec(d);
        far = std::max(far, dot(apart, apart));
      }
      if (far >= reach * reach) continue;
      same = far < within * within;
      if (same) continue;
      if (matrices[i].empty()) {
        const double* x = at.data() + kept[i] * N;
        matrices[i].resize(N * N);
        evaluate(p[which.data()[k]], L, x, 31, &n);
        inform(n, p[which.data()[k]], x, known.data());
        spread(n, reinterpret_cast<double(*)[N]>(matrices[i].data()));
      }
      double total = 0;
      for (int j = 0; j < N; ++j) {
        double s = 0;
        for (int c = 0; c < N; ++c) s += matrices[i][j * N + c] * d[c];
        total += s * d[j];
      }
      same = total < level;
    }
    keep.mutable_data()[k] = !same;
    if (!same) kept.push_back(k), matrices.emplace_back();
  }
  return keep;
}

// For rows in order of preference within each group, whether each is farther than `within` from all that are kept.
py::array_t<bool> distinct(Longs group, Doubles points, double within) {
  const py::ssize_t count = group.size(), width = count ? points.size() / count : 0;
  py::array_t<bool> keep(count);
  std::vector<py::ssize_t> kept;
  const std::int64_t* g = group.data();
  for (py::ssize_t k = 0; k < count; ++k) {
    if (k && g[k] != g[k - 1]) kept.clear();
    const double* a = points.data() + k * width;
    bool near = false;
    for (size_t i = 0; i < kept.size() && !near; ++i) {
      const double* b = points.data() + kept[i] * width;
      near = true;
      for (py::ssize_t j = 0; j < width && near; j += 3) {
        Vec apart = vec(a + j) - vec(b + j);
        near = dot(apart, apart) < within * within;
      }
    }
    keep.mutable_data()[k] = !near;
    if (!near) kept.push_back(k);
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
  m.def("information", &information);
  m.def("log_determinants", &log_determinants);
  m.def("separate", &separate);
  m.def("distinct", &distinct);
  m.def("stated", &stated_all);
}
