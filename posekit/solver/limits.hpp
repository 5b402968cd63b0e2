// Angles of limbs and pelvis, and their limits, by the formulas of posekit/solver/limits.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

namespace {

constexpr int J = 14;
constexpr int START[4] = {1, 2, 4, 5}, MID[4] = {6, 7, 10, 11}, END[4] = {8, 9, 12, 13};
constexpr double SIGN[4][4] = {{-1, -1, 1, -1}, {-1, 1, -1, -1}, {-1, -1, 1, 1}, {-1, 1, -1, 1}};
constexpr double PELVIS_SIGN[3] = {-1, 1, -1};
constexpr double VALGUS_SIGN[2] = {-1, 1};
constexpr double SEAM = -115.0 * M_PI / 180.0, LEAST_LEFT = 0.1;
constexpr int COUPLINGS = 12, KNOTS = 8;

// The layout of the dtype LIMITS of limits.py; all fields are doubles.
struct Limits {
  double mean[2][4][2], limit[4][4][2], pelvis[3][2], sinus[2], hip_turn[2];
  double by_elevation, between_hips, couplings, role[COUPLINGS][5], knots[COUPLINGS][3][KNOTS];
};

struct Vec {
  double x, y, z;
};
inline Vec vec(const double* p) { return {p[0], p[1], p[2]}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double norm(Vec a) { return std::sqrt(dot(a, a)); }
inline double turned(double a, double middle) { return a - 2 * M_PI * std::nearbyint((a - middle) / (2 * M_PI)); }

// The frame of torso or hips, and the maps G and H from velocities of its two directions to its rotation vector:
// G first' + H other'.
struct Frame {
  Vec forward, left, up, first, normal;
  double length, lean, across;
  bool by_down;  // the first axis is down (torso), or left (hips)
  // Transposed maps, applied to a derivative w by rotations: on_first = G' w, on_other = H' w.
  void pull(Vec w, Vec& on_first, Vec& on_other) const {
    double along = dot(w, first);
    on_first = (1 / length) * (cross(w, first) - (along * lean / across) * normal);
    on_other = (along / across) * normal;
  }
};

Frame frame(Vec first_way, Vec other, bool by_down) {
  Frame f;
  f.by_down = by_down;
  f.length = norm(first_way);
  f.first = (1 / f.length) * first_way;
  f.lean = dot(f.first, other);
  Vec off = other - f.lean * f.first;
  f.across = norm(off);
  Vec second = (1 / f.across) * off;
  f.normal = cross(f.first, second);
  Vec down = by_down ? f.first : second;
  f.left = by_down ? second : f.first;
  f.forward = cross(down, f.left);
  f.up = -1.0 * down;
  return f;
}
Frame torso_of(const double x[J][3]) { return frame(vec(x[3]) - vec(x[0]), vec(x[2]) - vec(x[1]), true); }
Frame hips_of(const double x[J][3], bool between) {
  return frame(vec(x[5]) - vec(x[4]), between ? vec(x[3]) - vec(x[0]) : vec(x[4]) - vec(x[3]), false);
}

double interpolated(double x, const double* at, const double* y, int n) {
  if (std::isnan(x)) return x;
  if (x <= at[0]) return y[0];
  for (int k = 1; k < n; ++k)
    if (x < at[k]) return y[k - 1] + (y[k] - y[k - 1]) / (at[k] - at[k - 1]) * (x - at[k - 1]);
  return y[n - 1];
}

// Powers and roots with the exponent of a sinus, fast for the usual exponents 2 and 3.
double raised(double x, double power) { return power == 2 ? x * x : power == 3 ? x * x * x : std::pow(x, power); }
double root(double x, double power) {
  return power == 2 ? std::sqrt(x) : power == 3 ? std::cbrt(x) : std::pow(x, 1 / power);
}

// Elevation, plane and turn of an arm, which do not depend on the Euler branch; zero for legs.
struct Reading {
  double elevation, plane, offset;
};
Reading reading_of(int limb, const double g[4]) {
  if (limb > 1) return {0, 0, 0};
  const double a = g[0] * SIGN[limb][0], b = g[1] * SIGN[limb][1];
  const double sb = std::sin(b), cb = std::cos(b), forward = std::sin(a) * cb, down = std::cos(a) * cb;
  const double elevation = std::atan2(std::sqrt(forward * forward + sb * sb), down), plane = std::atan2(sb, forward);
  const double twist = -2 * std::atan2(std::sin(a / 2) * std::sin(b / 2), std::cos(a / 2) * std::cos(b / 2));
  const double from_side = M_PI / 2 - (plane < SEAM ? plane + 2 * M_PI : plane);
  return {elevation, plane, twist - (1 - std::cos(elevation)) * from_side};
}

// Angles of a limb in one Euler branch and their bounds, radians: flexion or elevation, abduction, rotation, hinge.
struct Written {
  double value[4], bound[2][4];
};
// `slack` (radians) widens the sinus. A coupling to an unknown angle (NaN) adds no bound.
Written written(const Limits& L, int limb, const double g[4], const Reading& reading, int way, double slack) {
  const int kind = limb / 2, over = way / 2, flipped = way & 1;
  const bool arm = kind == 0 && L.by_elevation > 0;
  double a = g[0] * SIGN[limb][0], b = g[1] * SIGN[limb][1], c = g[2] * SIGN[limb][2], e = g[3] * SIGN[limb][3];
  double r[7] = {a + M_PI * over, over ? M_PI - b : b, c + M_PI * (over ^ flipped), flipped ? -e : e,
                 reading.elevation, reading.plane, 0};
  Written out;
  auto& bound = out.bound;
  double mean[2][4], middle[4], turn[2], outward[2] = {0, 0};
  bool turns[2] = {false, false};
  for (int i = 0; i < 4; ++i) {
    middle[i] = (L.mean[kind][i][0] + L.mean[kind][i][1]) / 2;
    r[i] = turned(r[i], middle[i]);
    for (int s = 0; s < 2; ++s) bound[s][i] = L.limit[limb][i][s], mean[s][i] = L.mean[kind][i][s];
  }
  if (kind == 1 && L.between_hips > 0) r[0] -= std::min(std::max(r[0] - middle[0], L.hip_turn[0]), L.hip_turn[1]);
  if (arm)
    for (int i = 0; i < 2; ++i) bound[0][i] = -INFINITY, bound[1][i] = INFINITY;
  const double sine = std::sin(r[3]);
  for (int k = 0; k < (int)L.couplings; ++k) {
    if ((int)L.role[k][0] != kind) continue;
    int target = L.role[k][1], side = L.role[k][2], of = L.role[k][3], n = L.role[k][4];
    double at = r[of], limit = interpolated(at, L.knots[k][0], L.knots[k][2], n);
    auto tighten = [&](double& own, double other) { own = side ? std::min(own, other) : std::max(own, other); };
    if (target == 4) tighten(bound[side][0], limit);
    else if (target == 6) turn[side] = limit, turns[side] = true;
    else if (target == 7) {
      double sign = 2 * side - 1, off = std::max(sign * limit, 0.0);
      double squarely = std::max(sign * interpolated(M_PI / 2, L.knots[k][0], L.knots[k][2], n), 0.0);
      if (off > 0) {
        double ratio = std::sin(off) / std::fabs(sine), add = std::asin(ratio < 1 ? ratio : 1.0) - squarely;
        outward[sign * VALGUS_SIGN[kind] * (sine < 0 ? -1 : 1) > 0] += std::max(add, 0.0);
      }
    } else {
      tighten(bound[side][target], limit);
      tighten(mean[side][target], interpolated(at, L.knots[k][0], L.knots[k][1], n));
    }
  }
  if (L.sinus[kind] > 0) {
    double used = 0, power = L.sinus[kind];
    for (int i = 0; i < 3; ++i) {
      double centre = i == 2 ? (mean[0][2] + mean[1][2]) / 2 : middle[i];
      if (i) {
        double left = root(std::max(1 - used, raised(LEAST_LEFT, power)), power);
        for (int s = 0; s < 2; ++s) bound[s][i] = centre + (bound[s][i] - centre) * left;
      }
      double off = r[i] - centre, half = off < 0 ? centre - L.limit[limb][i][0] : L.limit[limb][i][1] - centre;
      if (i < 2) used += raised(std::fabs(off) / (half + slack), power);
    }
  }
  if (turns[0] || turns[1]) {
    double centre = turns[0] && turns[1] ? (turn[0] + turn[1]) / 2 : turns[0] ? turn[0] : turn[1];
    double raw = turned(r[2] + reading.offset + M_PI * over, centre), shift = raw - r[2];
    r[2] = raw;
    for (int s = 0; s < 2; ++s) bound[s][2] = turns[s] ? turn[s] : bound[s][2] + shift;
  }
  bound[0][2] -= outward[0];
  bound[1][2] += outward[1];
  if (arm) r[0] = r[4];
  std::memcpy(out.value, r, sizeof out.value);
  return out;
}

struct Limb {
  double g[4], upper, lower, sa, ca, sb, cb;
  Vec u, l, a, b;
};
Limb limb_of(const double x[J][3], int m, const Frame& R) {
  Limb s;
  Vec u = vec(x[MID[m]]) - vec(x[START[m]]), l = vec(x[END[m]]) - vec(x[MID[m]]);
  s.upper = norm(u), s.lower = norm(l);
  s.u = (1 / s.upper) * u, s.l = (1 / s.lower) * l;
  double px = dot(R.forward, s.u), py = dot(R.left, s.u), pz = dot(R.up, s.u), h = std::sqrt(px * px + pz * pz);
  s.sa = h > 0 ? -px / h : 0.0, s.ca = h > 0 ? -pz / h : 1.0, s.sb = py, s.cb = h;
  s.a = s.sa * R.up - s.ca * R.forward;
  s.b = (s.sa * py) * R.forward + h * R.left + (s.ca * py) * R.up;
  double p = dot(s.a, s.l), q = -dot(s.b, s.l);
  s.g[0] = std::atan2(s.sa, s.ca), s.g[1] = std::atan2(py, h), s.g[2] = std::atan2(q, p);
  s.g[3] = std::atan2(std::sqrt(p * p + q * q), dot(s.u, s.l));
  return s;
}

// Angles of the hips' frame in the torso's frame, and the terms that their derivatives use.
struct Pelvis {
  double g[3], sine, cosine;
  Vec axis;
};
Pelvis pelvis_of(const Frame& torso, const Frame& hips) {
  Pelvis s;
  double px = -dot(torso.forward, hips.up), pz = -dot(torso.up, hips.up);
  s.sine = -dot(torso.left, hips.up), s.cosine = std::sqrt(px * px + pz * pz);
  double sa = s.cosine > 0 ? -px / s.cosine : 0.0, ca = s.cosine > 0 ? -pz / s.cosine : 1.0;
  s.axis = ca * torso.forward - sa * torso.up;
  s.g[0] = std::atan2(sa, ca), s.g[1] = std::atan2(s.sine, s.cosine);
  s.g[2] = std::atan2(dot(cross(hips.up, s.axis), hips.forward), dot(s.axis, hips.forward));
  return s;
}

// A limb as the check of joint ranges reports it: rows angle, lower bound, upper bound, tolerance, degrees.
struct Stated {
  double row[4][4];
};
// The usual Euler branch is reported if it passes, otherwise the branch with the smallest violation. The rotation is
// unknown (NaN) if the bend is below `straight`, or if `tolerance` does not determine it (validators/joint_range.py;
// all in degrees).
Stated stated(const Limits& L, int limb, const double g[4], double tolerance, double straight) {
  constexpr double RADIAN = M_PI / 180, UNSEEN = 45;
  const double sine = std::fabs(std::sin(g[3])), least = std::max(tolerance * RADIAN / M_PI, 2.2250738585072014e-308);
  const double turn = tolerance / std::max(std::isnan(sine) ? 1.0 : sine, least);
  const bool open = turn > UNSEEN || sine < std::sin(straight * RADIAN);
  const Reading reading = reading_of(limb, g);
  auto state = [&](int way, Stated& out) {
    const Written w = written(L, limb, g, reading, way, tolerance * RADIAN);
    double worst = NAN;
    for (int i = 0; i < 4; ++i) {
      out.row[0][i] = i == 2 && open ? NAN : w.value[i] / RADIAN, out.row[3][i] = i == 2 ? turn : tolerance;
      out.row[1][i] = w.bound[0][i] / RADIAN, out.row[2][i] = w.bound[1][i] / RADIAN;
      const double away = std::max(out.row[1][i] - out.row[0][i], out.row[0][i] - out.row[2][i]);
      worst = std::fmax(worst, away - out.row[3][i]);
    }
    return worst;
  };
  Stated best, other;
  if (!(state(limb < 2, best) > 0)) return best;
  double least_worst = INFINITY;
  for (int way = 0; way < (limb < 2 && L.by_elevation > 0 ? 2 : 4); ++way) {
    const double worst = state(way, other);
    if (worst < least_worst) least_worst = worst, best = other;
  }
  return best;
}

}  // namespace
