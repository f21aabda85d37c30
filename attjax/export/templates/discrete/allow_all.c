/* This policy was trained without a mask: every action is allowed. */
static void allow(const float w[3], int allowed[ATTJAX_ACTIONS])
{
    (void)w;
    for (int a = 0; a < ATTJAX_ACTIONS; a++) {
        allowed[a] = 1;
    }
}
