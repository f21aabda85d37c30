/* Returns how many decisions differ from those in attjax. */
static int compare(void)
{
    int failures = 0;

    for (int v = 0; v < VECTORS; v++) {
        const int action = attjax_decide(vectors[v].quaternion, vectors[v].angular_velocity);
        failures += action != vectors[v].action;
    }
    printf("vectors: %d of %d decisions as in attjax\n", VECTORS - failures, VECTORS);
    return failures;
}
