// Rigid-body dynamics of a tree of revolute and prismatic joints: Featherstone's algorithms with 3-vectors.
//
// The axis of every joint is the z axis of its body's frame (robot/constants.py turns the frames), so one kind of revolute
// and one kind of prismatic joint is left. R, p: orientation and origin of a body's frame in its parent's.
#pragma once
#include "lanes.hpp"

constexpr int MOST_JOINTS = 16;

// The constants of an arm; C is `double` where all rollouts have the same arm, a pack where each lane has its own.
template <class C> struct Arm {
  int joints;
  int parent[MOST_JOINTS];          // −1: the base
  int slides[MOST_JOINTS];          // 1: prismatic
  C rotation[MOST_JOINTS][9];       // of the body in its parent at q = 0, row by row
  C origin[MOST_JOINTS][3];         // [m]
  C mass[MOST_JOINTS];              // [kg]
  C moment[MOST_JOINTS][3];         // mass × centre of mass [kg m]
  C inertia[MOST_JOINTS][6];        // about the frame's origin [kg m²]: xx xy xz yy yz zz
  C armature[MOST_JOINTS];          // rotor inertia [kg m²]
  double gravity[3];                // [m/s²]
};

// The quantities of a body at one configuration, in its own frame.
template <class V> struct Body {
  V R[9], p[3];
  V w[3], dw[3], a[3];              // angular velocity, angular acceleration, acceleration of the origin less gravity
  V f[3], t[3];                     // force and moment about the origin
  V m, h[3], I[6];                  // composite mass, moment and inertia
};

// Sizes that the compiler knows where N > 0.
template <int N> constexpr int room() { return N ? N : MOST_JOINTS; }
template <int N> ALWAYS_INLINE int size(int joints) { return N ? N : joints; }

template <class V, class W> ALWAYS_INLINE void cross(const V *a, const W *b, V *c) {
  V x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  c[0] = x, c[1] = y, c[2] = z;
}
template <class V> ALWAYS_INLINE void rotate(const V *R, const V *x, V *y) {  // y = R x
  for (int r = 0; r < 3; r++) y[r] = R[3 * r] * x[0] + R[3 * r + 1] * x[1] + R[3 * r + 2] * x[2];
}
template <class V> ALWAYS_INLINE void rotate_back(const V *R, const V *x, V *y) {  // y = Rᵀ x
  for (int c = 0; c < 3; c++) y[c] = R[c] * x[0] + R[3 + c] * x[1] + R[6 + c] * x[2];
}
template <class V, class C> ALWAYS_INLINE void multiply(const C *S, const V *x, V *y) {  // y = S x, S symmetric
  V a = S[0] * x[0] + S[1] * x[1] + S[2] * x[2], b = S[1] * x[0] + S[3] * x[1] + S[4] * x[2];
  y[2] = S[2] * x[0] + S[4] * x[1] + S[5] * x[2];
  y[0] = a, y[1] = b;
}
template <class V> ALWAYS_INLINE void rotate_symmetric(const V *R, const V *S, V *T) {  // T = R S Rᵀ
  V A[9];
  for (int r = 0; r < 3; r++) multiply(S, R + 3 * r, A + 3 * r);
  for (int r = 0, k = 0; r < 3; r++)
    for (int c = r; c < 3; c++, k++) T[k] = A[3 * r] * R[3 * c] + A[3 * r + 1] * R[3 * c + 1] + A[3 * r + 2] * R[3 * c + 2];
}

// Set the frames of all bodies, for the algorithms below.
template <int N, class V, class C> static NOINLINE void place(const Arm<C> &arm, const V *q, Body<V> *bodies) {
  const int n = size<N>(arm.joints);
  for (int i = 0; i < n; i++) {
    Body<V> &body = bodies[i];
    const C *R = arm.rotation[i], *p = arm.origin[i];
    if (arm.slides[i]) {
      for (int k = 0; k < 9; k++) body.R[k] = V{} + R[k];
      for (int r = 0; r < 3; r++) body.p[r] = p[r] + R[3 * r + 2] * q[i];
    } else {
      V s, c;
      sine_cosine(q[i], s, c);
      for (int r = 0; r < 3; r++) {
        body.R[3 * r] = R[3 * r] * c + R[3 * r + 1] * s;
        body.R[3 * r + 1] = R[3 * r + 1] * c - R[3 * r] * s;
        body.R[3 * r + 2] = V{} + R[3 * r + 2];
        body.p[r] = V{} + p[r];
      }
    }
  }
}

// The terms of the dynamics that RNEA computes.
enum Terms { ALL_TERMS, WITHOUT_ACCELERATION, CENTRIPETAL_ONLY };

// τ = M(q)q̈ + C(q,q̇)q̇ + g(q) by the recursive Newton–Euler algorithm, after place(); q̈ = 0 WITHOUT_ACCELERATION, and gravity
// 0 as well for CENTRIPETAL_ONLY.
template <int N, Terms terms, class V, class C>
static NOINLINE void inverse_dynamics(const Arm<C> &arm, const V *qd, const V *qdd, Body<V> *bodies, V *tau) {
  const int n = size<N>(arm.joints);
  for (int i = 0; i < n; i++) {
    Body<V> &body = bodies[i];
    const int parent = arm.parent[i];
    if (parent < 0) {
      V up[3];
      for (int k = 0; k < 3; k++) {
        up[k] = number<V>(terms == CENTRIPETAL_ONLY ? 0.0 : -arm.gravity[k]);
        body.w[k] = body.dw[k] = V{};
      }
      rotate_back(body.R, up, body.a);
    } else {
      Body<V> &below = bodies[parent];
      V x[3], y[3], z[3], a[3];
      cross(below.w, body.p, x), cross(below.w, x, y), cross(below.dw, body.p, z);
      for (int k = 0; k < 3; k++) a[k] = below.a[k] + z[k] + y[k];
      rotate_back(body.R, below.w, body.w), rotate_back(body.R, below.dw, body.dw), rotate_back(body.R, a, body.a);
    }
    V v = qd[i];
    if (arm.slides[i]) {
      body.a[0] += 2.0 * v * body.w[1], body.a[1] -= 2.0 * v * body.w[0];
      if (terms == ALL_TERMS) body.a[2] += qdd[i];
    } else {
      body.dw[0] += body.w[1] * v, body.dw[1] -= body.w[0] * v;
      if (terms == ALL_TERMS) body.dw[2] += qdd[i];
      body.w[2] += v;
    }
    const C *h = arm.moment[i], *I = arm.inertia[i];
    V x[3], y[3], z[3], L[3], dL[3];
    cross(body.w, h, x), cross(body.w, x, y), cross(body.dw, h, z);
    for (int k = 0; k < 3; k++) body.f[k] = arm.mass[i] * body.a[k] + z[k] + y[k];
    multiply(I, body.w, L), multiply(I, body.dw, dL);
    cross(body.w, L, y), cross(body.a, h, z);
    for (int k = 0; k < 3; k++) body.t[k] = dL[k] + y[k] - z[k];
  }
  for (int i = n - 1; i >= 0; i--) {
    Body<V> &body = bodies[i];
    const int parent = arm.parent[i];
    tau[i] = arm.slides[i] ? body.f[2] : body.t[2];
    if (terms == ALL_TERMS) tau[i] += arm.armature[i] * qdd[i];
    if (parent >= 0) {
      Body<V> &below = bodies[parent];
      V f[3], t[3], x[3];
      rotate(body.R, body.f, f), rotate(body.R, body.t, t), cross(body.p, f, x);
      for (int k = 0; k < 3; k++) below.f[k] += f[k], below.t[k] += t[k] + x[k];
    }
  }
}

// p = M(q)q̇ and the gradient C(q,q̇)ᵀq̇ = ∂/∂q ½q̇ᵀM(q)q̇ of the kinetic energy, after place(): with w and v the velocities of a body and
// of its origin, and L and H the momentum of all that it carries, H about the origin, p is that along the joint's axis and the gradient
// its product with the motion that turning the joint gives to (w, v).
template <int N, class V, class C>
static NOINLINE void momentum(const Arm<C> &arm, const V *qd, Body<V> *bodies, V *p, V *gradient) {
  const int n = size<N>(arm.joints);
  for (int i = 0; i < n; i++) {  // v in a, L in f, H in t
    Body<V> &body = bodies[i];
    const int parent = arm.parent[i];
    if (parent < 0) {
      for (int k = 0; k < 3; k++) body.w[k] = body.a[k] = V{};
    } else {
      Body<V> &below = bodies[parent];
      V v[3];
      cross(below.w, body.p, v);
      for (int k = 0; k < 3; k++) v[k] += below.a[k];
      rotate_back(body.R, below.w, body.w), rotate_back(body.R, v, body.a);
    }
    (arm.slides[i] ? body.a : body.w)[2] += qd[i];
    const C *h = arm.moment[i];
    V x[3], y[3];
    cross(body.w, h, x), cross(body.a, h, y), multiply(arm.inertia[i], body.w, body.t);
    for (int k = 0; k < 3; k++) body.f[k] = arm.mass[i] * body.a[k] + x[k], body.t[k] -= y[k];
  }
  for (int i = n - 1; i >= 0; i--) {
    Body<V> &body = bodies[i];
    const V *w = body.w, *v = body.a, *L = body.f, *H = body.t;
    p[i] = (arm.slides[i] ? L[2] : H[2]) + arm.armature[i] * qd[i];
    gradient[i] = L[0] * w[1] - L[1] * w[0];
    if (!arm.slides[i]) gradient[i] = H[0] * w[1] - H[1] * w[0] + (L[0] * v[1] - L[1] * v[0]);
    if (arm.parent[i] < 0) continue;
    Body<V> &below = bodies[arm.parent[i]];
    V f[3], t[3], x[3];
    rotate(body.R, L, f), rotate(body.R, H, t), cross(body.p, f, x);
    for (int k = 0; k < 3; k++) below.f[k] += f[k], below.t[k] += t[k] + x[k];
  }
}

// M(q), both triangles, by the composite rigid body algorithm, after place().
template <int N, class V, class C>
static NOINLINE void mass_matrix(const Arm<C> &arm, Body<V> *bodies, V (*M)[room<N>()]) {
  const int n = size<N>(arm.joints);
  for (int i = 0; i < n; i++) {
    Body<V> &body = bodies[i];
    body.m = V{} + arm.mass[i];
    for (int k = 0; k < 3; k++) body.h[k] = V{} + arm.moment[i][k];
    for (int k = 0; k < 6; k++) body.I[k] = V{} + arm.inertia[i][k];
    for (int j = 0; j < n; j++) M[i][j] = V{};
  }
  for (int i = n - 1; i >= 0; i--) {
    Body<V> &body = bodies[i];
    V f[3], t[3];  // force and moment for a unit acceleration of joint i
    if (arm.slides[i]) {
      f[0] = f[1] = t[2] = V{}, f[2] = body.m, t[0] = body.h[1], t[1] = -body.h[0];
      M[i][i] = body.m + arm.armature[i];
    } else {
      f[0] = -body.h[1], f[1] = body.h[0], f[2] = V{}, t[0] = body.I[2], t[1] = body.I[4], t[2] = body.I[5];
      M[i][i] = body.I[5] + arm.armature[i];
    }
    if (arm.parent[i] >= 0) {  // join the body to its parent, by Steiner's theorem
      Body<V> &below = bodies[arm.parent[i]];
      const V *p = body.p;
      V T[6], g[3], k[3];
      rotate_symmetric(body.R, body.I, T), rotate(body.R, body.h, g);
      for (int r = 0; r < 3; r++) k[r] = g[r] + body.m * p[r];
      below.m += body.m;
      for (int r = 0; r < 3; r++) below.h[r] += k[r];
      below.I[0] += T[0] + (p[1] * g[1] + p[2] * g[2]) + (k[1] * p[1] + k[2] * p[2]);
      below.I[3] += T[3] + (p[0] * g[0] + p[2] * g[2]) + (k[0] * p[0] + k[2] * p[2]);
      below.I[5] += T[5] + (p[0] * g[0] + p[1] * g[1]) + (k[0] * p[0] + k[1] * p[1]);
      below.I[1] += T[1] - p[0] * g[1] - k[0] * p[1];
      below.I[2] += T[2] - p[0] * g[2] - k[0] * p[2];
      below.I[4] += T[4] - p[1] * g[2] - k[1] * p[2];
    }
    for (int j = i; arm.parent[j] >= 0;) {  // carry force and moment down to each supporting joint
      Body<V> &carried = bodies[j];
      V x[3], y[3], z[3];
      rotate(carried.R, f, x), rotate(carried.R, t, y), cross(carried.p, x, z);
      for (int k = 0; k < 3; k++) f[k] = x[k], t[k] = y[k] + z[k];
      j = arm.parent[j];
      M[i][j] = M[j][i] = arm.slides[j] ? f[2] : t[2];
    }
  }
}

// The factors L D Lᵀ of a symmetric positive definite M, and x = M⁻¹ b by them.
template <int N, class V> struct Factors { V L[room<N>()][room<N>()], D[room<N>()], inverse[room<N>()]; };

template <int N, class V> static NOINLINE void factorise(int joints, V (*M)[room<N>()], Factors<N, V> &F) {
  const int n = size<N>(joints);
  for (int j = 0; j < n; j++) {
    V d = M[j][j];
    for (int k = 0; k < j; k++) d -= F.L[j][k] * F.L[j][k] * F.D[k];
    F.D[j] = d, F.inverse[j] = 1.0 / d;
    for (int i = j + 1; i < n; i++) {
      V y = M[i][j];
      for (int k = 0; k < j; k++) y -= F.L[i][k] * F.L[j][k] * F.D[k];
      F.L[i][j] = y * F.inverse[j];
    }
  }
}
template <int N, class V> static NOINLINE void solve(int joints, const Factors<N, V> &F, const V *b, V *x) {
  const int n = size<N>(joints);
  for (int i = 0; i < n; i++) {
    V y = b[i];
    for (int k = 0; k < i; k++) y -= F.L[i][k] * x[k];
    x[i] = y;
  }
  for (int i = n - 1; i >= 0; i--) {
    V y = x[i] * F.inverse[i];
    for (int k = i + 1; k < n; k++) y -= F.L[k][i] * x[k];
    x[i] = y;
  }
}

// τ = Jᵀf of a force f on a point of a body, in axes of the base, after place(): the point's offset is in the body's frame.
template <int N, class V, class C>
static NOINLINE void point_force_torque(const Arm<C> &arm, Body<V> *bodies, int body, const double *offset, const V *force, V *tau) {
  const int n = size<N>(arm.joints);
  for (int i = 0; i < n; i++) tau[i] = V{};
  int chain[MOST_JOINTS], length = 0;
  for (int i = body; i >= 0; i = arm.parent[i]) chain[length++] = i;
  V f[3] = {force[0], force[1], force[2]}, t[3], r[3];
  for (int k = length - 1; k >= 0; k--) {  // the force in axes of the body
    V x[3];
    rotate_back(bodies[chain[k]].R, f, x);
    for (int j = 0; j < 3; j++) f[j] = x[j];
  }
  for (int k = 0; k < 3; k++) r[k] = number<V>(offset[k]);
  cross(r, f, t);
  for (int i = body; i >= 0; i = arm.parent[i]) {
    tau[i] = arm.slides[i] ? f[2] : t[2];
    V x[3], y[3], z[3];
    rotate(bodies[i].R, f, x), rotate(bodies[i].R, t, y), cross(bodies[i].p, x, z);
    for (int k = 0; k < 3; k++) f[k] = x[k], t[k] = y[k] + z[k];
  }
}

// The pose of a frame on a body in the base, after place(): R (row by row) and p, given the frame's own in the body, −1 for the base.
// With columns it gets its Jacobian too, 6 rows of `joints`: of its origin, then angular, in axes of the base.
static NOINLINE void frame_kinematics(const Arm<double> &arm, const Body<double> *bodies, int body, const double *placement, double *R, double *p, double *columns) {
  int chain[MOST_JOINTS], length = 0;
  for (int i = body; i >= 0; i = arm.parent[i]) chain[length++] = i;
  double axes[MOST_JOINTS][3], origins[MOST_JOINTS][3], turn[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, at[3] = {0, 0, 0};
  const auto move = [&](const double *by, const double *offset) {
    double x[3], A[9];
    rotate(turn, offset, x);
    for (int r = 0; r < 3; r++)
      for (int c = 0; c < 3; c++) A[3 * r + c] = turn[3 * r] * by[c] + turn[3 * r + 1] * by[3 + c] + turn[3 * r + 2] * by[6 + c];
    for (int k = 0; k < 9; k++) turn[k] = A[k];
    for (int k = 0; k < 3; k++) at[k] += x[k];
  };
  for (int k = length - 1; k >= 0; k--) {
    move(bodies[chain[k]].R, bodies[chain[k]].p);
    for (int r = 0; r < 3; r++) axes[k][r] = turn[3 * r + 2], origins[k][r] = at[r];
  }
  move(placement, placement + 9);
  for (int k = 0; k < 9; k++) R[k] = turn[k];
  for (int k = 0; k < 3; k++) p[k] = at[k];
  if (!columns) return;
  const int n = arm.joints;
  for (int k = 0; k < 6 * n; k++) columns[k] = 0;
  for (int k = 0; k < length; k++) {
    const double lever[3] = {at[0] - origins[k][0], at[1] - origins[k][1], at[2] - origins[k][2]};
    double linear[3];
    cross(axes[k], lever, linear);
    for (int r = 0; r < 3; r++) {
      double *column = columns + r * n + chain[k];
      if (arm.slides[chain[k]]) column[0] = axes[k][r];
      else column[0] = linear[r], column[3 * n] = axes[k][r];
    }
  }
}
