/* With g = Aw, w.g is the square of the largest rate of the coasting motion. */
static const float peak_rate_form[3][3] = $form;

/*
 * Change of the angular velocity by each action, rad/s; for that change u, u.Au and the most that
 * the body's turning adds while the torque acts; and the square of the rate that it may lead to,
 * from $margin times the rate limit to the middle between that and the limit, rad^2/s^2.
 */
static const float impulse[ATTJAX_ACTIONS][3] = $impulse;
static const float own_gain[ATTJAX_ACTIONS] = $own_gain;
static const float limit_squared[ATTJAX_ACTIONS] = $limit_squared;

/*
 * Which actions keep the rate within the limit for good: those after which the coasting motion
 * never passes it, those that lower the peak of a motion that does, and no torque.
 */
static void allow(const float w[3], int allowed[ATTJAX_ACTIONS])
{
    float g[3];
    float peak_squared;

    for (int i = 0; i < 3; i++) {
        const float *row = peak_rate_form[i];
        g[i] = row[0] * w[0] + row[1] * w[1] + row[2] * w[2];
    }
    peak_squared = w[0] * g[0] + w[1] * g[1] + w[2] * g[2];
    for (int a = 0; a < ATTJAX_ACTIONS; a++) {
        const float *u = impulse[a];
        const float gain = 2.0f * (u[0] * g[0] + u[1] * g[1] + u[2] * g[2]) + own_gain[a];
        allowed[a] = peak_squared + gain <= limit_squared[a] || gain < 0.0f;
    }
    allowed[ATTJAX_NO_TORQUE] = 1;
}
