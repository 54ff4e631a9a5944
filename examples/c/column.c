/* A column, clamped at the bottom, whose top a program of ours pulls sideways.
 *
 * Shows: creation from a file, an input that is set in every step, the step, resultants, a probe, a
 * field, a snapshot and the way back, callbacks, and what to do with errors.
 *
 * Build, shared:
 *
 *     cc column.c -o column $(pkg-config --cflags --libs urlsph)
 *
 * Build, static:
 *
 *     cc column.c -o column $(pkg-config --cflags urlsph) \
 *         $(pkg-config --variable=libdir urlsph)/liburlsph.a \
 *         $(pkg-config --static --libs-only-l urlsph | sed 's/-lurlsph//')
 *
 * Run:
 *
 *     ./column column.json
 */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include <urlsph.h>

/* Steps of the communication with the outside, and how many of them. */
#define STEP 5e-3 /* s */
#define STEPS 20

static void on_log(const urlsph_log_record *record, void *user_data) {
    (void)user_data;
    if (record->level == URLSPH_LOG_ERROR) fprintf(stderr, "log: %s\n", record->message);
}

/* Prints why the last call on this simulation failed, and hands its status on. */
static urlsph_status report(const urlsph_simulation *column, urlsph_status status) {
    urlsph_error error;
    if (urlsph_get_last_error(column, &error, sizeof error) == URLSPH_OK &&
        error.code == status) {
        fprintf(stderr, "error: %s\n", error.text);
    } else {
        fprintf(stderr, "error: %s\n", urlsph_status_text(status));
    }
    return status;
}

/* Leaves the function with the status of a call that failed. */
#define TRY(call)                                                \
    do {                                                         \
        const urlsph_status status_ = (call);                    \
        if (status_ != URLSPH_OK) return report(column, status_); \
    } while (0)

static urlsph_status run(urlsph_simulation *column, double *displacement, size_t room) {
    urlsph_callbacks callbacks = {0};
    callbacks.log = on_log;
    TRY(urlsph_set_callbacks(column, &callbacks, sizeof callbacks));

    /* Names become indices once; the indices stay the same. */
    size_t top, bottom, probe, field;
    TRY(urlsph_find_patch(column, "top", &top));
    TRY(urlsph_find_patch(column, "bottom", &bottom));
    TRY(urlsph_find_probe(column, "top_centre", &probe));
    TRY(urlsph_find_field(column, "displacement", &field));

    printf("%10s %14s %14s %14s\n", "time [s]", "pull [N]", "support [N]", "motion [m]");
    for (int i = 1; i <= STEPS; ++i) {
        /* The pull grows with time. One traction [Pa] for the whole patch; one per particle of the
         * patch would do as well. */
        const double traction[3] = {1e4 * i / STEPS, 0.0, 0.0};
        TRY(urlsph_set_traction(column, top, traction, 3));

        /* As many stable steps as it takes, ending exactly STEP later. */
        TRY(urlsph_step(column, STEP));

        double time;
        urlsph_resultant pull, support;
        urlsph_probe_motion motion;
        TRY(urlsph_get_time(column, &time));
        TRY(urlsph_get_resultant(column, top, &pull, sizeof pull));
        TRY(urlsph_get_resultant(column, bottom, &support, sizeof support));
        TRY(urlsph_get_probe_motion(column, probe, &motion, sizeof motion));
        printf("%10.4f %14.6g %14.6g %14.6g\n", time, pull.force[0], support.force[0],
               motion.displacement[0]);
    }

    /* A field: particles x 3, row-major. */
    urlsph_counts counts = {0};
    TRY(urlsph_get_counts(column, &counts, sizeof counts));
    TRY(urlsph_read_field(column, field, displacement, room));
    double largest = 0.0;
    for (size_t i = 0; i < counts.particles; ++i) {
        if (displacement[3 * i] > largest) largest = displacement[3 * i];
    }
    printf("largest displacement of %zu particles after %" PRIu64 " steps: %g m\n",
           counts.particles, counts.steps, largest);

    urlsph_energies energies;
    TRY(urlsph_get_energies(column, &energies, sizeof energies));
    printf("work done on the column %g J, ledger closes to %g J\n", energies.external_work,
           energies.closure_error);
    return URLSPH_OK;
}

/* Leaves a state, comes back, and leaves it again by the same way: to the bit. */
static urlsph_status there_and_back(urlsph_simulation *column, uint8_t *snapshot, size_t room) {
    size_t size;
    uint64_t first, second;
    TRY(urlsph_save_snapshot(column, snapshot, room, &size));
    TRY(urlsph_step(column, STEP));
    TRY(urlsph_get_state_hash(column, &first));
    TRY(urlsph_restore_snapshot(column, snapshot, size));
    TRY(urlsph_step(column, STEP));
    TRY(urlsph_get_state_hash(column, &second));
    printf("a step, and the same step after a restore: %s\n",
           first == second ? "the same bits" : "DIFFERENT BITS");
    return first == second ? URLSPH_OK : URLSPH_INTERNAL;
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: %s SCENE.json\n", argv[0]);
        return URLSPH_INVALID_ARGUMENT;
    }
    if (urlsph_abi_version() != URLSPH_ABI_VERSION) {
        fprintf(stderr, "compiled for urlsph %s, but found %s\n", URLSPH_VERSION,
                urlsph_version());
        return URLSPH_INVALID_ARGUMENT;
    }

    /* Options may be NULL; here they choose the number of threads. */
    urlsph_options options = {0};
    options.threads = 2;

    /* There is no handle to ask after a failed creation, so the error comes by itself. */
    urlsph_simulation *column;
    urlsph_error error;
    urlsph_status status = urlsph_create_from_file(argv[1], &options, sizeof options, &column,
                                                   &error, sizeof error);
    if (status != URLSPH_OK) {
        fprintf(stderr, "error: %s\n", error.text);
        return status;
    }

    /* The library writes into memory of ours. */
    urlsph_counts counts = {0};
    size_t bytes = 0;
    status = urlsph_get_counts(column, &counts, sizeof counts);
    if (status == URLSPH_OK) status = urlsph_get_snapshot_size(column, &bytes);
    double *displacement = malloc(3 * counts.particles * sizeof *displacement);
    uint8_t *snapshot = malloc(bytes);
    if (status == URLSPH_OK && displacement && snapshot) {
        status = run(column, displacement, 3 * counts.particles);
        if (status == URLSPH_OK) status = there_and_back(column, snapshot, bytes);
    } else if (status == URLSPH_OK) {
        status = URLSPH_OUT_OF_MEMORY;
    }

    free(snapshot);
    free(displacement);
    urlsph_destroy(column);
    return status;
}
