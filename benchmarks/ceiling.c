// The agent step of many spacecraft as fast as one core can: LANES spacecraft a register, the
// whole step in registers. Arrays hold one component after the other, each over n spacecraft;
// n is a multiple of LANES.
#include <math.h>
#include <stdint.h>

#ifdef __AVX512F__
#include <immintrin.h>
#define LANES 16
#else
#define LANES 8
#endif
#define INLINE static inline __attribute__((always_inline))
#define EACH(l) for (int l = 0; l < LANES; l++)

typedef float vec __attribute__((vector_size(4 * LANES)));
typedef int32_t ivec __attribute__((vector_size(4 * LANES)));
typedef vec anywhere __attribute__((aligned(4), may_alias));
typedef ivec ianywhere __attribute__((aligned(4), may_alias));
typedef struct { vec q[4], u[3]; } state; // u = ω dt/4, so that half an increment of q is Ω(u) q

enum { FRAMESKIP = 20, ACTIONS = 19 };
static const float DT = 1.0f / 240, PI = 3.14159265f;

typedef struct {
  float inertia[3], table[3][2 * 16]; // torques, one row an axis
  float rate_limit, goal_angle, min_slew, max_slew;
  int32_t max_steps;
} parameters;

int lanes(void) { return LANES; }

INLINE vec load(const float *x) { return *(const anywhere *)x; }
INLINE void store(float *x, vec value) { *(anywhere *)x = value; }
INLINE vec where(ivec mask, vec a, vec b) { return (vec)((mask & (ivec)a) | (~mask & (ivec)b)); }
INLINE vec root(vec x) { EACH(l) x[l] = sqrtf(x[l]); return x; }

INLINE int any(ivec mask) {
#ifdef __AVX512F__
  return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask);
#else
  int found = 0;
  EACH(l) found |= mask[l];
  return found;
#endif
}

INLINE vec torque(const float table[2 * 16], ivec action) {
#if LANES == 16 && !defined(__clang__)
  return __builtin_shuffle(load(table), load(table + 16), action);
#else
  vec chosen;
  EACH(l) chosen[l] = table[action[l]];
  return chosen;
#endif
}

// Ω(u) q (Eq. 10), half an increment of q
INLINE void turn(vec out[4], const vec u[3], const vec q[4]) {
  out[0] = u[2] * q[1] - u[1] * q[2] + u[0] * q[3];
  out[1] = u[0] * q[2] - u[2] * q[0] + u[1] * q[3];
  out[2] = u[1] * q[0] - u[0] * q[1] + u[2] * q[3];
  out[3] = -(u[0] * q[0]) - u[1] * q[1] - u[2] * q[2];
}

// sum + half an increment of u, from a and b, which are u or a multiple (Eq. 6)
INLINE void spin(vec out[3], const vec sum[3], const vec a[3], const vec b[3], const float c[3]) {
  for (int i = 0; i < 3; i++) out[i] = sum[i] + c[i] * (a[(i + 1) % 3] * b[(i + 2) % 3]);
}

// One RK4 step. change is three times that of q since start, summed apart from q, whose float32
// would round small increments away. As the stages are y2 = s + k1/2, y3 = s + k2/2 and
// y4 = s + k3, the increment of u is (y2 + 2 y3 + y4 - 4 s + k4/2)/3. Both forms have additions
// where they can, which are free beside products.
INLINE void rk4(vec change[4], vec u[3], const vec start[4], const vec *push, const float c[3]) {
  vec q[4], y[4], k[4], u2[3], u3[3], u4[3], twice[3], from[3], from2[3], sum[3];
  for (int i = 0; i < 4; i++) q[i] = start[i] + change[i] * (1.0f / 3);
  for (int i = 0; i < 3; i++) from[i] = push ? u[i] + push[i] : u[i];
  for (int i = 0; i < 3; i++) from2[i] = push ? from[i] + push[i] : u[i];
  turn(k, u, q);
  spin(u2, from, u, u, c);
  for (int i = 0; i < 4; i++) y[i] = q[i] + k[i], change[i] += k[i];
  turn(k, u2, y);
  spin(u3, from, u2, u2, c);
  for (int i = 0; i < 4; i++) y[i] = q[i] + k[i], change[i] += k[i] + k[i];
  for (int i = 0; i < 3; i++) twice[i] = u3[i] + u3[i];
  turn(k, twice, y);
  spin(u4, from2, twice, u3, c);
  for (int i = 0; i < 4; i++) y[i] = q[i] + k[i], change[i] += k[i];
  turn(k, u4, y);
  for (int i = 0; i < 4; i++) change[i] += k[i];
  for (int i = 0; i < 3; i++) {
    sum[i] = (u2[i] - u[i]) + (twice[i] - (u[i] + u[i])) + (u4[i] - u[i]);
    if (push) sum[i] += push[i];
  }
  spin(sum, sum, u4, u4, c);
  for (int i = 0; i < 3; i++) u[i] += sum[i] * (1.0f / 3);
}

INLINE state propagate(state s, ivec action, const parameters *p) {
  const float *m = p->inertia;
  const float c[3] = {2 * (m[1] - m[2]) / m[0], 2 * (m[2] - m[0]) / m[1], 2 * (m[0] - m[1]) / m[2]};
  vec push[3], change[4] = {{0}};
  for (int i = 0; i < 3; i++) push[i] = torque(p->table[i], action) * (DT * DT / 8 / m[i]);
  rk4(change, s.u, s.q, push, c);
  for (int k = 0; k < FRAMESKIP; k++) rk4(change, s.u, s.q, 0, c);
  for (int i = 0; i < 4; i++) s.q[i] += change[i] * (1.0f / 3);
  vec scale = 1 / root(s.q[0] * s.q[0] + s.q[1] * s.q[1] + s.q[2] * s.q[2] + s.q[3] * s.q[3]);
  for (int i = 0; i < 4; i++) s.q[i] *= scale;
  return s;
}

INLINE state load_state(const float *q, const float *w, int n) {
  state s;
  for (int i = 0; i < 4; i++) s.q[i] = load(q + i * n);
  for (int i = 0; i < 3; i++) s.u[i] = load(w + i * n) * (DT / 4);
  return s;
}

INLINE void store_state(float *q, float *w, int n, state s) {
  for (int i = 0; i < 4; i++) store(q + i * n, s.q[i]);
  for (int i = 0; i < 3; i++) store(w + i * n, s.u[i] * (4 / DT));
}

// Fly through actions, one row of n a step.
void physics(int steps, int n, float *q, float *w, const int32_t *action, const parameters *p) {
  for (int t = 0; t < steps; t++, action += n)
    for (int b = 0; b < n; b += LANES)
      store_state(q + b, w + b, n,
                  propagate(load_state(q + b, w + b, n), *(const ianywhere *)(action + b), p));
}

// atan2(y, x) for y >= 0, to 2e-7
INLINE vec atan2_upper(vec y, vec x) {
  vec ax = where(x < 0, -x, x);
  ivec steep = y > ax;
  vec t = where(steep, ax, y) / where(steep, y, ax), z = t * t;
  vec r = z * 0.00283406419f - 0.0160050299f;
  r = r * z + 0.0425876081f;
  r = r * z - 0.0749544576f;
  r = r * z + 0.106367543f;
  r = r * z - 0.142025709f;
  r = r * z + 0.199924842f;
  r = r * z - 0.333330661f;
  r = (r * z + 1) * t;
  r = where(steep, PI / 2 - r, r);
  return where(x < 0, PI - r, r);
}

// exp(x) for -80 < x <= 0, relatively to 2e-7
INLINE vec exp_negative(vec x) {
  x *= 1.44269504f;
  ivec whole = __builtin_convertvector(x - 0.5f, ivec);
  vec f = x - __builtin_convertvector(whole, vec);
  vec r = f * 0.00134004327f + 0.00967603736f;
  r = r * f + 0.0555032715f;
  r = r * f + 0.240221068f;
  r = r * f + 0.693147182f;
  r = r * f + 1;
  return (vec)((ivec)r + (whole << 23));
}

// Eq. 12 and 13, with the terminal rewards
INLINE vec paper_reward(const vec before[4], const vec after[4], ivec terminated, ivec truncated,
                        const parameters *p) {
  vec zero = {0};
  vec sine2_before = before[0] * before[0] + before[1] * before[1] + before[2] * before[2];
  vec sine2 = after[0] * after[0] + after[1] * after[1] + after[2] * after[2];
  vec angle = 2 * atan2_upper(root(sine2), after[3]);
  ivec inside = angle <= p->goal_angle;
  ivec goal = (before[3] > 0.5f) & (after[3] > 0.5f);
  ivec antipode = (before[3] < -0.5f) & (after[3] < -0.5f);
  ivec improved = (goal & (sine2 < sine2_before)) | (antipode & (sine2 > sine2_before)) |
                  (~(goal | antipode) & (after[3] > before[3]));
  vec reward = exp_negative(angle * (-1 / (0.14f * 2 * PI)));
  reward += where(inside, zero + 9, zero) - where(improved, zero, zero + 1);
  reward = where(truncated, where(inside, zero + 50, zero), reward);
  return where(terminated, zero - 50, reward);
}

static float uniform(uint64_t *seed) { // xorshift64
  *seed ^= *seed << 13;
  *seed ^= *seed >> 7;
  *seed ^= *seed << 17;
  return (float)(*seed >> 40) * 0x1p-24f;
}

// A new episode for one spacecraft; the pointers are to its first components.
static void restart(int n, float *q, float *w, int32_t *time, float *observation,
                    const parameters *p, uint64_t *seed) {
  float cosine = 2 * uniform(seed) - 1, azimuth = 2 * PI * uniform(seed);
  float half = 0.5f * (p->min_slew + uniform(seed) * (p->max_slew - p->min_slew));
  float sine = sqrtf(1 - cosine * cosine);
  q[0] = sine * cosf(azimuth) * sinf(half);
  q[n] = sine * sinf(azimuth) * sinf(half);
  q[2 * n] = cosine * sinf(half);
  q[3 * n] = cosf(half);
  for (int i = 0; i < 3; i++) w[i * n] = 0;
  for (int i = 0; i < 11; i++) observation[i * n] = i < 4 ? q[i * n] : 0;
  *time = 0;
}

INLINE void observe(float *observation, int n, state s) { // Eq. 11
  vec rate[4], half[3];
  for (int i = 0; i < 3; i++) half[i] = s.u[i] * (2 / DT);
  turn(rate, half, s.q);
  for (int i = 0; i < 4; i++) store(observation + i * n, s.q[i]);
  for (int i = 0; i < 4; i++) store(observation + (4 + i) * n, rate[i]);
  for (int i = 0; i < 3; i++) store(observation + (8 + i) * n, 2 * half[i]);
}

// An agent step of LANES spacecraft with all that learning needs: observation (11 rows), reward,
// ended (1: overspeed, 2: time limit), and a new episode where one ended.
INLINE void step(int n, float *q, float *w, int32_t *time, const int32_t *action,
                 const parameters *p, float *observation, float *reward, int32_t *ended,
                 uint64_t *seed) {
  state before = load_state(q, w, n), s = propagate(before, *(const ianywhere *)action, p);
  ivec clock = *(const ianywhere *)time + 1;
  vec speed2 = s.u[0] * s.u[0] + s.u[1] * s.u[1] + s.u[2] * s.u[2];
  ivec terminated = speed2 > p->rate_limit * p->rate_limit * (DT * DT / 16);
  ivec truncated = ~terminated & (clock >= p->max_steps);
  ivec flags = (terminated & 1) | (truncated & 2);
  store(reward, paper_reward(before.q, s.q, terminated, truncated, p));
  store_state(q, w, n, s);
  observe(observation, n, s);
  *(ianywhere *)time = clock;
  *(ianywhere *)ended = flags;
  if (any(flags)) EACH(l) if (ended[l])
    restart(n, q + l, w + l, time + l, observation + l, p, seed);
}

// Fly through actions, one row of n a step; observation, reward and ended are of the last step.
void full(int steps, int n, float *q, float *w, int32_t *time, const int32_t *action,
          const parameters *p, float *observation, float *reward, int32_t *ended,
          uint64_t *seed) {
  for (int t = 0; t < steps; t++, action += n)
    for (int b = 0; b < n; b += LANES)
      step(n, q + b, w + b, time + b, action + b, p, observation + b, reward + b, ended + b, seed);
}
