
#define CONES $cone_count

/* Axes of the body, the directions that they keep out of, seen from the target, and half-angles. */
static const float cone_axes[CONES][3] = $cone_axes;
static const float cone_directions[CONES][3] = $cone_directions;
static const float half_angles[CONES] = $half_angles;

/* Values of P, falling, and the angles within which braking from them ends, rad. */
#define EDGES $edge_count
static const float edges[EDGES] = $edges;
static const float stopping_angles[EDGES] = $stopping_angles;

/* How far the nearest cone is from its axis, rad; negative within it. */
static float clearance(const float q[4])
{
    float least = 4.0f;

    for (int c = 0; c < CONES; c++) {
        const float *d = cone_directions[c], *axis = cone_axes[c];
        float seen[3], across[3];
        float cross = 0.0f, dot = 0.0f, angle;
        for (int i = 0; i < 3; i++) { /* d + 2 v x (v x d - qs d), with v the vector part of q */
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            across[i] = q[j] * d[k] - q[k] * d[j] - q[3] * d[i];
        }
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            seen[i] = d[i] + 2.0f * (q[j] * across[k] - q[k] * across[j]);
        }
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const float x = axis[j] * seen[k] - axis[k] * seen[j];
            cross += x * x;
            dot += axis[i] * seen[i];
        }
        angle = atan2f(sqrtf(cross), dot) - half_angles[c];
        least = angle < least ? angle : least;
    }
    return least;
}

/* The square of a P from which braking ends before the nearest cone. */
static float kept_squared(const float quaternion[4], float peak)
{
    const float angle = clearance(quaternion) - $reserve - $period_s * (peak + $most_growth);
    float kept = 0.0f;

    for (int n = 0; n + 1 < EDGES; n++) {
        const float width = stopping_angles[n] - stopping_angles[n + 1];
        float share = (angle - stopping_angles[n + 1]) / width;
        share = share < 0.0f ? 0.0f : share > 1.0f ? 1.0f : share;
        kept += share * (edges[n] - edges[n + 1]);
    }
    return kept * kept;
}
