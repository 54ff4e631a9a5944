/* The contract of the C ABI: every function, and every way in which a call can be wrong. */

#include <dirent.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include <urlsph.h>

#include "check.h"

/* The files of the scenes, the arguments of the program: a column, a metal with heat, and a block
 * between planes of contact. */
static const char *scene_path, *metal_path, *contact_path;

static const double nan_ = NAN;
static const double inf_ = INFINITY;

/* An overlong struct, as of a later version of the library. */
#define LATER(type)         \
    struct {                \
        type now;           \
        unsigned char later[16]; \
    }

static urlsph_simulation *create_from(const char *path, const char *override, size_t threads) {
    urlsph_options options = {0};
    options.overrides = override ? &override : NULL;
    options.override_count = override ? 1 : 0;
    options.threads = threads;
    urlsph_simulation *s = NULL;
    urlsph_error error;
    if (urlsph_create_from_file(path, &options, sizeof options, &s, &error, sizeof error) !=
        URLSPH_OK) {
        printf("    %s\n", error.text);
    }
    return s;
}

static urlsph_simulation *create(const char *override, size_t threads) {
    return create_from(scene_path, override, threads);
}

static uint64_t hash(const urlsph_simulation *s) {
    uint64_t h = 0;
    return urlsph_get_state_hash(s, &h) == URLSPH_OK ? h : 0;
}

static urlsph_error last(const urlsph_simulation *s) {
    urlsph_error e;
    memset(&e, 0xff, sizeof e);
    urlsph_get_last_error(s, &e, sizeof e);
    return e;
}

static size_t patch(const urlsph_simulation *s, const char *name) {
    size_t i = SIZE_MAX;
    urlsph_find_patch(s, name, &i);
    return i;
}

static size_t field(const urlsph_simulation *s, const char *name) {
    size_t i = SIZE_MAX;
    urlsph_find_field(s, name, &i);
    return i;
}

/* What was wrong is told by status and by text. */
#define FAILS(call, status)            \
    do {                               \
        CHECK((call) == (status));     \
        CHECK(last(s).code == (status)); \
        CHECK(last(s).text[0] != 0);   \
    } while (0)
#define INVALID(call) FAILS(call, URLSPH_INVALID_ARGUMENT)

static void versions(void) {
    CHECK(strcmp(urlsph_version(), URLSPH_VERSION) == 0);
    CHECK(urlsph_abi_version() == URLSPH_ABI_VERSION);
    char version[32];
    snprintf(version, sizeof version, "%d.%d.%d", URLSPH_VERSION_MAJOR, URLSPH_VERSION_MINOR,
             URLSPH_VERSION_PATCH);
    CHECK(strcmp(version, URLSPH_VERSION) == 0);
    for (int32_t status = URLSPH_OK; status <= URLSPH_INTERNAL; ++status) {
        CHECK(strlen(urlsph_status_text(status)) > 1);
        CHECK(strcmp(urlsph_status_text(status), "unknown status") != 0);
    }
    CHECK(strcmp(urlsph_status_text(-1), "unknown status") == 0);
    CHECK(strcmp(urlsph_status_text(INT32_MAX), "unknown status") == 0);
}

static void creation_from_text(void) {
    FILE *file = fopen(scene_path, "rb");
    CHECK(file);
    char json[8192];
    size_t length = fread(json, 1, sizeof json - 1, file);
    fclose(file);
    json[length] = 0;

    urlsph_simulation *s = NULL;
    CHECK(urlsph_create_from_json(json, NULL, 0, &s, NULL, 0) == URLSPH_OK);
    const char *title = NULL;
    CHECK(urlsph_get_title(s, &title) == URLSPH_OK);
    CHECK(strcmp(title, "Test column") == 0);
    CHECK(last(s).code == URLSPH_OK && last(s).text[0] == 0);
    urlsph_simulation *same = create(NULL, 1);
    CHECK(hash(s) == hash(same) && hash(s) != 0);
    CHECK(urlsph_destroy(same) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void creation_fails(void) {
    urlsph_simulation *s = (urlsph_simulation *)&s;
    urlsph_error e;
    const urlsph_simulation *none = NULL;

#define WRONG(call, status)                                    \
    do {                                                       \
        s = (urlsph_simulation *)&s;                           \
        memset(&e, 0xff, sizeof e);                            \
        CHECK((call) == (status));                             \
        CHECK(s == none);                                      \
        CHECK(e.code == (status));                             \
        CHECK(strlen(e.text) > 10 && strlen(e.text) < sizeof e.text); \
    } while (0)
#define JSON(text) urlsph_create_from_json(text, NULL, 0, &s, &e, sizeof e)
#define FROM(path) urlsph_create_from_file(path, NULL, 0, &s, &e, sizeof e)

    WRONG(JSON(NULL), URLSPH_INVALID_ARGUMENT);
    WRONG(JSON("\xff\xfe"), URLSPH_INVALID_ARGUMENT);
    CHECK(strstr(e.text, "json"));
    WRONG(JSON(""), URLSPH_PARSE);
    WRONG(JSON("{"), URLSPH_PARSE);
    WRONG(JSON("[]"), URLSPH_PARSE);
    WRONG(FROM(NULL), URLSPH_INVALID_ARGUMENT);
    WRONG(FROM("\xff"), URLSPH_INVALID_ARGUMENT);
    WRONG(FROM("no/such/file.json"), URLSPH_IO);
    CHECK(strstr(e.text, "no/such/file.json"));
    WRONG(FROM("."), URLSPH_IO);
    WRONG(FROM(""), URLSPH_IO);

    urlsph_options o = {0};
    const char *overrides[] = {"material.neo_hookean.density=-1", NULL};
    o.overrides = overrides;
    o.override_count = 1;
#define OPTIONS(size) urlsph_create_from_file(scene_path, &o, size, &s, &e, sizeof e)
    WRONG(OPTIONS(sizeof o), URLSPH_INVALID_SCENE);
    CHECK(strcmp(e.path, "material.neo_hookean.density") == 0);
    CHECK(!e.has_particle && !e.has_position && !e.has_time);
    overrides[0] = "nothing.of.this=1";
    WRONG(OPTIONS(sizeof o), URLSPH_PARSE);
    o.override_count = 2;
    WRONG(OPTIONS(sizeof o), URLSPH_INVALID_ARGUMENT);
    CHECK(strstr(e.text, "overrides[1]"));
    o.override_count = SIZE_MAX;
    WRONG(OPTIONS(sizeof o), URLSPH_INVALID_ARGUMENT);
    o.overrides = NULL;
    o.override_count = 1;
    WRONG(OPTIONS(sizeof o), URLSPH_INVALID_ARGUMENT);
    o.override_count = 0;
    WRONG(OPTIONS(0), URLSPH_INVALID_ARGUMENT);
    WRONG(OPTIONS(sizeof(void *)), URLSPH_INVALID_ARGUMENT);
    o.threads = SIZE_MAX;
    WRONG(OPTIONS(sizeof o), URLSPH_INVALID_ARGUMENT);

    /* A later version's options are fine as long as they ask for nothing that is unknown here. */
    LATER(urlsph_options) later;
    memset(&later, 0, sizeof later);
    CHECK(urlsph_create_from_file(scene_path, &later.now, sizeof later, &s, &e, sizeof e) ==
          URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
    later.later[3] = 1;
    WRONG(urlsph_create_from_file(scene_path, &later.now, sizeof later, &s, &e, sizeof e),
          URLSPH_INVALID_ARGUMENT);

    /* Where the error should go is wrong itself: the status remains. */
    CHECK(urlsph_create_from_json("{", NULL, 0, NULL, &e, sizeof e) == URLSPH_INVALID_ARGUMENT);
    CHECK(urlsph_create_from_json("{", NULL, 0, &s, &e, 3) == URLSPH_INVALID_ARGUMENT);
    CHECK(urlsph_create_from_json("{", NULL, 0, &s, NULL, 0) == URLSPH_PARSE);
    CHECK(s == NULL);
#undef WRONG
#undef JSON
#undef FROM
#undef OPTIONS
}

/* Calls everything with one handle, and all else as it should be. */
static bool all_give(urlsph_simulation *s, urlsph_status wanted) {
    bool same = true;
    double d[1024], values[3] = {0};
    size_t n = 0, particles[64];
    uint64_t u = 0;
    uint8_t bytes[1] = {0};
    const char *text = NULL;
    urlsph_counts counts;
    urlsph_energies energies;
    urlsph_momenta momenta;
    urlsph_patch_info patch_info;
    urlsph_resultant resultant;
    urlsph_heat_resultant heat_resultant;
    urlsph_contact_info contact_info;
    urlsph_contact_resultant contact_resultant;
    urlsph_field_info field_info;
    urlsph_view view;
    urlsph_probe_info probe_info;
    urlsph_probe_motion motion;
    urlsph_input_info input_info;
#define GIVES(call)                                                             \
    do {                                                                        \
        const urlsph_status status = (call);                                    \
        if (status != wanted) {                                                 \
            printf("    %s gives %s\n", #call, urlsph_status_text(status));     \
            same = false;                                                       \
        }                                                                       \
    } while (0)
    GIVES(urlsph_set_callbacks(s, NULL, 0));
    GIVES(urlsph_get_title(s, &text));
    GIVES(urlsph_get_counts(s, &counts, sizeof counts));
    GIVES(urlsph_get_time(s, d));
    GIVES(urlsph_get_end_time(s, d));
    GIVES(urlsph_get_stable_step(s, d));
    GIVES(urlsph_get_energies(s, &energies, sizeof energies));
    GIVES(urlsph_get_momenta(s, &momenta, sizeof momenta));
    GIVES(urlsph_find_patch(s, "top", &n));
    GIVES(urlsph_get_patch_info(s, 0, &patch_info, sizeof patch_info));
    GIVES(urlsph_read_patch_particles(s, 0, particles, 64));
    GIVES(urlsph_read_patch_areas(s, 0, d, 1024));
    GIVES(urlsph_read_patch_normals(s, 0, d, 1024));
    GIVES(urlsph_get_resultant(s, 0, &resultant, sizeof resultant));
    GIVES(urlsph_find_field(s, "velocity", &n));
    GIVES(urlsph_get_field_info(s, 0, &field_info, sizeof field_info));
    GIVES(urlsph_read_field(s, 0, d, 1024));
    GIVES(urlsph_get_view(s, 0, &view, sizeof view));
    GIVES(urlsph_get_generation(s, &u));
    GIVES(urlsph_find_probe(s, "corner", &n));
    GIVES(urlsph_get_probe_info(s, 0, &probe_info, sizeof probe_info));
    GIVES(urlsph_get_probe_motion(s, 0, &motion, sizeof motion));
    GIVES(urlsph_get_input_info(s, 0, &input_info, sizeof input_info));
    GIVES(urlsph_get_snapshot_size(s, &n));
    GIVES(urlsph_get_state_hash(s, &u));
    if (wanted != URLSPH_OK) {
        GIVES(urlsph_set_traction(s, 0, values, 3));
        GIVES(urlsph_set_pressure(s, 0, values, 1));
        GIVES(urlsph_set_velocity(s, 0, values, 3));
        GIVES(urlsph_set_heat_flux(s, 0, values, 1));
        GIVES(urlsph_set_temperature(s, 0, values, 1));
        GIVES(urlsph_set_convection(s, 0, values, 1, values, 1));
        GIVES(urlsph_get_heat_resultant(s, 0, &heat_resultant, sizeof heat_resultant));
        GIVES(urlsph_find_contact(s, "floor", &n));
        GIVES(urlsph_get_contact_info(s, 0, &contact_info, sizeof contact_info));
        GIVES(urlsph_get_contact_resultant(s, 0, &contact_resultant, sizeof contact_resultant));
        GIVES(urlsph_read_input(s, 0, URLSPH_TRACTION, d, 1024, &n));
        GIVES(urlsph_step(s, 1e-5));
        GIVES(urlsph_advance_to(s, 1.0));
        GIVES(urlsph_save_snapshot(s, bytes, 1, &n));
        GIVES(urlsph_restore_snapshot(s, bytes, 1));
        GIVES(urlsph_save_snapshot_to_file(s, "never.snapshot"));
        GIVES(urlsph_restore_snapshot_from_file(s, "never.snapshot"));
    }
#undef GIVES
    return same;
}

static void handles(void) {
    urlsph_error e;
    CHECK(all_give(NULL, URLSPH_INVALID_ARGUMENT));
    CHECK(urlsph_get_last_error(NULL, &e, sizeof e) == URLSPH_INVALID_ARGUMENT);
    CHECK(urlsph_destroy(NULL) == URLSPH_OK);

    urlsph_simulation *s = create(NULL, 1);
    CHECK(s);
    CHECK(all_give(s, URLSPH_OK));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
    CHECK(all_give(s, URLSPH_INVALID_ARGUMENT));
    CHECK(urlsph_get_last_error(s, &e, sizeof e) == URLSPH_INVALID_ARGUMENT);
    CHECK(urlsph_destroy(s) == URLSPH_INVALID_ARGUMENT);

    /* A stale handle does not meet the simulation that came after it. */
    urlsph_simulation *next = create(NULL, 1);
    CHECK(next && next != s);
    CHECK(all_give(s, URLSPH_INVALID_ARGUMENT));
    CHECK(urlsph_destroy(next) == URLSPH_OK);

    /* Something else altogether. */
    double other = 0.0;
    CHECK(all_give((urlsph_simulation *)&other, URLSPH_INVALID_ARGUMENT));
    CHECK(urlsph_destroy((urlsph_simulation *)&other) == URLSPH_INVALID_ARGUMENT);
    CHECK(urlsph_destroy((urlsph_simulation *)((char *)&other + 1)) == URLSPH_INVALID_ARGUMENT);
}

static void null_outputs(void) {
    urlsph_simulation *s = create(NULL, 1);
    CHECK(s);
    const uint64_t before = hash(s);
    double d[1024];
    size_t n;
    uint8_t byte = 0;
    INVALID(urlsph_get_title(s, NULL));
    INVALID(urlsph_get_counts(s, NULL, sizeof(urlsph_counts)));
    INVALID(urlsph_get_time(s, NULL));
    INVALID(urlsph_get_end_time(s, NULL));
    INVALID(urlsph_get_stable_step(s, NULL));
    INVALID(urlsph_get_energies(s, NULL, sizeof(urlsph_energies)));
    INVALID(urlsph_get_momenta(s, NULL, sizeof(urlsph_momenta)));
    INVALID(urlsph_find_patch(s, "top", NULL));
    INVALID(urlsph_find_patch(s, NULL, &n));
    INVALID(urlsph_find_patch(s, "\xc3", &n));
    INVALID(urlsph_get_patch_info(s, 0, NULL, sizeof(urlsph_patch_info)));
    INVALID(urlsph_read_patch_particles(s, 0, NULL, 1024));
    INVALID(urlsph_read_patch_areas(s, 0, NULL, 1024));
    INVALID(urlsph_read_patch_normals(s, 0, NULL, 1024));
    INVALID(urlsph_get_resultant(s, 0, NULL, sizeof(urlsph_resultant)));
    INVALID(urlsph_find_field(s, "velocity", NULL));
    INVALID(urlsph_find_field(s, NULL, &n));
    INVALID(urlsph_get_field_info(s, 0, NULL, sizeof(urlsph_field_info)));
    INVALID(urlsph_read_field(s, 0, NULL, 1024));
    INVALID(urlsph_get_view(s, 0, NULL, sizeof(urlsph_view)));
    INVALID(urlsph_get_generation(s, NULL));
    INVALID(urlsph_find_probe(s, "corner", NULL));
    INVALID(urlsph_find_probe(s, NULL, &n));
    INVALID(urlsph_get_probe_info(s, 0, NULL, sizeof(urlsph_probe_info)));
    INVALID(urlsph_get_probe_motion(s, 0, NULL, sizeof(urlsph_probe_motion)));
    INVALID(urlsph_get_input_info(s, 0, NULL, sizeof(urlsph_input_info)));
    INVALID(urlsph_set_traction(s, patch(s, "top"), NULL, 3));
    INVALID(urlsph_set_pressure(s, patch(s, "side"), NULL, 1));
    INVALID(urlsph_set_velocity(s, patch(s, "bottom"), NULL, 3));
    INVALID(urlsph_read_input(s, patch(s, "top"), URLSPH_TRACTION, NULL, 1024, &n));
    INVALID(urlsph_read_input(s, patch(s, "top"), URLSPH_TRACTION, d, 1024, NULL));
    INVALID(urlsph_get_snapshot_size(s, NULL));
    INVALID(urlsph_save_snapshot(s, NULL, SIZE_MAX, &n));
    INVALID(urlsph_restore_snapshot(s, NULL, 100));
    INVALID(urlsph_restore_snapshot(s, &byte, SIZE_MAX));
    INVALID(urlsph_save_snapshot_to_file(s, NULL));
    INVALID(urlsph_restore_snapshot_from_file(s, NULL));
    INVALID(urlsph_get_state_hash(s, NULL));
    CHECK(urlsph_get_last_error(s, NULL, sizeof(urlsph_error)) == URLSPH_INVALID_ARGUMENT);
    CHECK(strstr(last(s).text, "hash"));

    /* Misaligned pointers. */
    char *odd = (char *)d + 1;
    INVALID(urlsph_get_time(s, (void *)odd));
    INVALID(urlsph_read_field(s, 0, (void *)odd, 1000));
    INVALID(urlsph_get_energies(s, (void *)odd, sizeof(urlsph_energies)));
    INVALID(urlsph_set_traction(s, patch(s, "top"), (void *)odd, 3));
    CHECK(hash(s) == before);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void struct_sizes(void) {
    urlsph_simulation *s = create(NULL, 1);
    CHECK(s);
/* `first` is the size in the first version: less is refused, more is zeroed beyond what we know. */
#define SIZES_SINCE(call, type, first)                                          \
    do {                                                                        \
        LATER(type) v;                                                          \
        memset(&v, 0xaa, sizeof v);                                             \
        INVALID(call(&v.now, 0));                                               \
        INVALID(call(&v.now, 1));                                               \
        INVALID(call(&v.now, (first) - sizeof(int64_t)));                       \
        unsigned char *raw = (unsigned char *)&v;                               \
        for (size_t i = 0; i < sizeof v; ++i) CHECK(raw[i] == 0xaa);            \
        CHECK(call(&v.now, sizeof v) == URLSPH_OK);                             \
        for (size_t i = 0; i < sizeof v.later; ++i) CHECK(v.later[i] == 0);     \
        memset(&v, 0xaa, sizeof v);                                             \
        CHECK(call(&v.now, sizeof v.now) == URLSPH_OK);                         \
        for (size_t i = 0; i < sizeof v.later; ++i) CHECK(v.later[i] == 0xaa);  \
        memset(&v, 0xaa, sizeof v);                                             \
        CHECK(call(&v.now, first) == URLSPH_OK);                                \
        for (size_t i = first; i < sizeof v; ++i) CHECK(raw[i] == 0xaa);        \
    } while (0)
#define SIZES(call, type) SIZES_SINCE(call, type, sizeof(type))
#define COUNTS(p, n) urlsph_get_counts(s, p, n)
#define ENERGIES(p, n) urlsph_get_energies(s, p, n)
#define MOMENTA(p, n) urlsph_get_momenta(s, p, n)
#define PATCH_INFO(p, n) urlsph_get_patch_info(s, 0, p, n)
#define RESULTANT(p, n) urlsph_get_resultant(s, 0, p, n)
#define FIELD_INFO(p, n) urlsph_get_field_info(s, 0, p, n)
#define VIEW(p, n) urlsph_get_view(s, 0, p, n)
#define PROBE_INFO(p, n) urlsph_get_probe_info(s, 0, p, n)
#define MOTION(p, n) urlsph_get_probe_motion(s, 0, p, n)
#define INPUT_INFO(p, n) urlsph_get_input_info(s, 0, p, n)
    SIZES_SINCE(COUNTS, urlsph_counts, offsetof(urlsph_counts, contacts));
    SIZES_SINCE(ENERGIES, urlsph_energies, offsetof(urlsph_energies, thermal));
    SIZES(MOMENTA, urlsph_momenta);
    SIZES(PATCH_INFO, urlsph_patch_info);
    SIZES(RESULTANT, urlsph_resultant);
    SIZES_SINCE(FIELD_INFO, urlsph_field_info, offsetof(urlsph_field_info, is_present));
    SIZES(VIEW, urlsph_view);
    SIZES(PROBE_INFO, urlsph_probe_info);
    SIZES_SINCE(MOTION, urlsph_probe_motion, offsetof(urlsph_probe_motion, temperature));
    SIZES(INPUT_INFO, urlsph_input_info);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
    s = create_from(metal_path, NULL, 1);
    CHECK(s);
#define HEAT_RESULTANT(p, n) urlsph_get_heat_resultant(s, 0, p, n)
    SIZES(HEAT_RESULTANT, urlsph_heat_resultant);
    INVALID(urlsph_get_heat_resultant(s, 0, NULL, sizeof(urlsph_heat_resultant)));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
    s = create_from(contact_path, NULL, 1);
    CHECK(s);
#define CONTACT_INFO(p, n) urlsph_get_contact_info(s, 0, p, n)
#define CONTACT_RESULTANT(p, n) urlsph_get_contact_resultant(s, 0, p, n)
    SIZES(CONTACT_INFO, urlsph_contact_info);
    SIZES(CONTACT_RESULTANT, urlsph_contact_resultant);
    INVALID(urlsph_get_contact_info(s, 0, NULL, sizeof(urlsph_contact_info)));
    INVALID(urlsph_get_contact_resultant(s, 0, NULL, sizeof(urlsph_contact_resultant)));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void patches(void) {
    urlsph_simulation *s = create(NULL, 2);
    CHECK(s);
    urlsph_counts counts;
    CHECK(urlsph_get_counts(s, &counts, sizeof counts) == URLSPH_OK);
    CHECK(counts.particles == 3 * 5 * 3 && counts.pairs > counts.particles);
    CHECK(counts.steps == 0 && counts.threads == 2 && counts.probes == 2 && counts.inputs == 3);
    CHECK(counts.patches >= 9);

    size_t top = SIZE_MAX;
    CHECK(urlsph_find_patch(s, "top", &top) == URLSPH_OK);
    urlsph_patch_info info;
    CHECK(urlsph_get_patch_info(s, top, &info, sizeof info) == URLSPH_OK);
    CHECK(strcmp(info.name, "top") == 0 && info.particles == 9);
    CHECK_NEAR(info.area, 1.0, 1e-14);

    size_t particles[9];
    double areas[9], normals[27], *initial = malloc(3 * counts.particles * sizeof *initial);
    CHECK(initial);
    CHECK(urlsph_read_patch_particles(s, top, particles, 9) == URLSPH_OK);
    CHECK(urlsph_read_patch_areas(s, top, areas, 9) == URLSPH_OK);
    CHECK(urlsph_read_patch_normals(s, top, normals, 27) == URLSPH_OK);
    CHECK(urlsph_read_field(s, field(s, "initial_position"), initial, 3 * counts.particles) ==
          URLSPH_OK);
    double sum = 0.0;
    for (size_t i = 0; i < 9; ++i) {
        CHECK(particles[i] < counts.particles && (i == 0 || particles[i] > particles[i - 1]));
        CHECK(initial[3 * particles[i] + 1] == 2.0);
        CHECK(normals[3 * i] == 0.0 && normals[3 * i + 1] == 1.0 && normals[3 * i + 2] == 0.0);
        sum += areas[i];
    }
    CHECK_NEAR(sum, 1.0, 1e-14);
    free(initial);

    /* Too small by one, and not touched. */
    particles[8] = 77;
    areas[8] = 77.0;
    INVALID(urlsph_read_patch_particles(s, top, particles, 8));
    INVALID(urlsph_read_patch_areas(s, top, areas, 8));
    INVALID(urlsph_read_patch_normals(s, top, normals, 26));
    CHECK(strstr(last(s).text, "26") && strstr(last(s).text, "27"));
    CHECK(particles[8] == 77 && areas[8] == 77.0);

    /* Out of range, unknown. */
    INVALID(urlsph_get_patch_info(s, counts.patches, &info, sizeof info));
    INVALID(urlsph_get_patch_info(s, SIZE_MAX, &info, sizeof info));
    INVALID(urlsph_read_patch_particles(s, SIZE_MAX, particles, 9));
    INVALID(urlsph_read_patch_areas(s, SIZE_MAX, areas, 9));
    INVALID(urlsph_read_patch_normals(s, SIZE_MAX, normals, 27));
    urlsph_resultant resultant;
    INVALID(urlsph_get_resultant(s, counts.patches, &resultant, sizeof resultant));
    INVALID(urlsph_find_patch(s, "tpo", &top));
    CHECK(strstr(last(s).text, "top"));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void fields(void) {
    urlsph_simulation *s = create(NULL, 2);
    CHECK(s);
    const double pull[3] = {1e4, 2e4, 0.0};
    CHECK(urlsph_set_traction(s, patch(s, "top"), pull, 3) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    urlsph_counts counts;
    CHECK(urlsph_get_counts(s, &counts, sizeof counts) == URLSPH_OK);
    double *values = malloc((9 * counts.particles + 1) * sizeof *values);
    CHECK(values);
    size_t views = 0, absent = 0;
    for (size_t f = 0; f < counts.fields; ++f) {
        urlsph_field_info info;
        CHECK(urlsph_get_field_info(s, f, &info, sizeof info) == URLSPH_OK);
        CHECK(info.components == 1 || info.components == 3 || info.components == 9);
        CHECK(strlen(info.name) > 0 && strlen(info.unit) > 0 && strlen(info.description) > 0);
        CHECK(info.configuration >= URLSPH_CONFIGURATION_INITIAL &&
              info.configuration <= URLSPH_CONFIGURATION_TWO_POINT);
        size_t found;
        CHECK(urlsph_find_field(s, info.name, &found) == URLSPH_OK && found == f);

        const size_t needed = counts.particles * info.components;
        if (!info.is_present) {
            values[0] = 77.0;
            INVALID(urlsph_read_field(s, f, values, needed));
            CHECK(strcmp(last(s).field, info.name) == 0 && values[0] == 77.0);
            ++absent;
            continue;
        }
        INVALID(urlsph_read_field(s, f, values, needed - 1));
        INVALID(urlsph_read_field(s, f, values, 0));
        values[needed] = 77.0;
        CHECK(urlsph_read_field(s, f, values, 9 * counts.particles + 1) == URLSPH_OK);
        CHECK(values[needed] == 77.0);
        for (size_t i = 0; i < needed; ++i) CHECK(isfinite(values[i]));

        urlsph_view view;
        if (!info.has_view) {
            INVALID(urlsph_get_view(s, f, &view, sizeof view));
            CHECK(strcmp(last(s).field, info.name) == 0);
            continue;
        }
        ++views;
        CHECK(urlsph_get_view(s, f, &view, sizeof view) == URLSPH_OK);
        CHECK(view.particles == counts.particles && view.components == info.components);
        CHECK(view.component_stride >= view.particles);
        for (size_t slot = 0; slot < view.particles; ++slot) {
            for (size_t c = 0; c < view.components; ++c) {
                CHECK(view.data[c * view.component_stride + slot] ==
                      values[view.order[slot] * view.components + c]);
            }
        }
        uint64_t generation;
        CHECK(urlsph_get_generation(s, &generation) == URLSPH_OK);
        CHECK(generation == view.generation);
    }
    CHECK(views >= 3 && absent == 3);
    INVALID(urlsph_read_field(s, field(s, "temperature"), values, counts.particles));
    CHECK(strstr(last(s).text, "`heat`"));
    uint64_t before, after;
    CHECK(urlsph_get_generation(s, &before) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-5) == URLSPH_OK);
    CHECK(urlsph_get_generation(s, &after) == URLSPH_OK);
    CHECK(after != before);

    urlsph_field_info info;
    urlsph_view view;
    size_t n;
    INVALID(urlsph_get_field_info(s, counts.fields, &info, sizeof info));
    INVALID(urlsph_read_field(s, SIZE_MAX, values, 9 * counts.particles));
    INVALID(urlsph_get_view(s, counts.fields, &view, sizeof view));
    INVALID(urlsph_find_field(s, "colour", &n));
    CHECK(strstr(last(s).text, "cauchy_stress"));
    free(values);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void inputs(void) {
    urlsph_simulation *s = create(NULL, 2);
    CHECK(s);
    bool seen[8] = {false};
    for (size_t i = 0; i < 3; ++i) {
        urlsph_input_info info;
        CHECK(urlsph_get_input_info(s, i, &info, sizeof info) == URLSPH_OK);
        seen[info.quantity] = true;
        const bool pressure = info.quantity == URLSPH_PRESSURE;
        CHECK(info.components == (pressure ? 1 : 3));
        CHECK(info.particles == (pressure ? 15 : 9));
        CHECK(info.per_particle == (info.quantity == URLSPH_TRACTION));
    }
    CHECK(seen[URLSPH_TRACTION] && seen[URLSPH_PRESSURE] && seen[URLSPH_VELOCITY]);
    urlsph_input_info info;
    INVALID(urlsph_get_input_info(s, 3, &info, sizeof info));

    const size_t top = patch(s, "top"), side = patch(s, "side"), bottom = patch(s, "bottom");
    double values[45], back[45];
    size_t count;
    for (int i = 0; i < 45; ++i) values[i] = 100.0 * i;

    /* One for the patch, one per particle; what was set is read back. */
    CHECK(urlsph_set_traction(s, top, values, 3) == URLSPH_OK);
    CHECK(urlsph_set_traction(s, top, values, 27) == URLSPH_OK);
    CHECK(urlsph_read_input(s, top, URLSPH_TRACTION, back, 27, &count) == URLSPH_OK);
    CHECK(count == 27 && memcmp(back, values, sizeof(double[27])) == 0);
    CHECK(urlsph_set_pressure(s, side, values, 15) == URLSPH_OK);
    CHECK(urlsph_set_pressure(s, side, values + 7, 1) == URLSPH_OK);
    CHECK(urlsph_read_input(s, side, URLSPH_PRESSURE, back, 45, &count) == URLSPH_OK);
    CHECK(back[0] == 700.0);
    CHECK(urlsph_set_velocity(s, bottom, values, 27) == URLSPH_OK);
    CHECK(urlsph_set_velocity(s, bottom, values, 3) == URLSPH_OK);

    const uint64_t before = hash(s);
    INVALID(urlsph_set_traction(s, top, values, 0));
    INVALID(urlsph_set_traction(s, top, values, 1));
    INVALID(urlsph_set_traction(s, top, values, 9));
    INVALID(urlsph_set_traction(s, top, values, 28));
    INVALID(urlsph_set_traction(s, top, values, SIZE_MAX));
    INVALID(urlsph_set_traction(s, side, values, 3));
    INVALID(urlsph_set_traction(s, SIZE_MAX, values, 3));
    INVALID(urlsph_set_pressure(s, side, values, 3));
    INVALID(urlsph_set_pressure(s, top, values, 1));
    INVALID(urlsph_set_velocity(s, bottom, values, 2));
    INVALID(urlsph_set_velocity(s, top, values, 3));
    values[26] = nan_;
    INVALID(urlsph_set_traction(s, top, values, 27));
    values[26] = inf_;
    INVALID(urlsph_set_traction(s, top, values, 27));
    INVALID(urlsph_read_input(s, top, URLSPH_TRACTION, back, 26, &count));
    INVALID(urlsph_read_input(s, top, URLSPH_VELOCITY, back, 45, &count));
    INVALID(urlsph_read_input(s, top, 0, back, 45, &count));
    INVALID(urlsph_read_input(s, top, -7, back, 45, &count));
    INVALID(urlsph_read_input(s, SIZE_MAX, URLSPH_TRACTION, back, 45, &count));
    CHECK(hash(s) == before);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* Flux, temperature and convection: set, read back, refused. */
static void heat_inputs(void) {
    urlsph_simulation *s = create_from(metal_path, NULL, 2);
    CHECK(s);
    const size_t top = patch(s, "top"), side = patch(s, "side"), back = patch(s, "back");
    const size_t bottom = patch(s, "bottom");
    urlsph_counts counts;
    CHECK(urlsph_get_counts(s, &counts, sizeof counts) == URLSPH_OK && counts.inputs == 6);
    bool seen[8] = {false};
    for (size_t i = 0; i < counts.inputs; ++i) {
        urlsph_input_info info;
        CHECK(urlsph_get_input_info(s, i, &info, sizeof info) == URLSPH_OK);
        seen[info.quantity] = true;
        CHECK(info.components == (info.quantity == URLSPH_TRACTION ? 3 : 1));
    }
    CHECK(seen[URLSPH_HEAT_FLUX] && seen[URLSPH_TEMPERATURE] && seen[URLSPH_AMBIENT_TEMPERATURE] &&
          seen[URLSPH_CONVECTION_COEFFICIENT]);

    double values[15], back_[15];
    size_t count;
    for (int i = 0; i < 15; ++i) values[i] = 300.0 + i;
    CHECK(urlsph_set_heat_flux(s, top, values, 1) == URLSPH_OK);
    CHECK(urlsph_set_heat_flux(s, top, values, 9) == URLSPH_OK);
    CHECK(urlsph_read_input(s, top, URLSPH_HEAT_FLUX, back_, 15, &count) == URLSPH_OK);
    CHECK(count == 9 && memcmp(back_, values, sizeof(double[9])) == 0);
    CHECK(urlsph_set_temperature(s, bottom, values, 9) == URLSPH_OK);
    CHECK(urlsph_set_temperature(s, bottom, values, 1) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, side, values, 1, values, 15) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, side, values + 1, 15 - 14, NULL, 0) == URLSPH_OK);
    CHECK(urlsph_read_input(s, side, URLSPH_AMBIENT_TEMPERATURE, back_, 15, &count) == URLSPH_OK);
    CHECK(count == 15 && memcmp(back_, values, sizeof values) == 0);
    CHECK(urlsph_read_input(s, side, URLSPH_CONVECTION_COEFFICIENT, back_, 15, &count) ==
          URLSPH_OK);
    CHECK(count == 1 && back_[0] == 301.0);
    /* The coefficient is the scene's here; the ambient temperature is ours. */
    CHECK(urlsph_set_convection(s, back, NULL, 0, values + 9, 1) == URLSPH_OK);

    const uint64_t before = hash(s);
    const double cold = 0.0, negative = -1.0;
    INVALID(urlsph_set_heat_flux(s, top, values, 2));
    INVALID(urlsph_set_heat_flux(s, top, NULL, 0));
    INVALID(urlsph_set_heat_flux(s, top, &nan_, 1));
    INVALID(urlsph_set_heat_flux(s, bottom, values, 1));
    CHECK(strstr(last(s).text, "heat_flux") && strcmp(last(s).boundary, "bottom") == 0);
    INVALID(urlsph_set_heat_flux(s, SIZE_MAX, values, 1));
    INVALID(urlsph_set_temperature(s, bottom, &cold, 1));
    CHECK(strstr(last(s).text, "0 K"));
    INVALID(urlsph_set_temperature(s, bottom, &inf_, 1));
    INVALID(urlsph_set_temperature(s, top, values, 1));
    INVALID(urlsph_set_temperature(s, bottom, values, 10));
    INVALID(urlsph_set_convection(s, side, &negative, 1, values, 1));
    INVALID(urlsph_set_convection(s, side, values, 1, &cold, 1));
    INVALID(urlsph_set_convection(s, side, values, 1, values, 14));
    INVALID(urlsph_set_convection(s, side, values, 0, values, 1));
    INVALID(urlsph_set_convection(s, side, NULL, 1, values, 1));
    INVALID(urlsph_set_convection(s, side, values, 1, NULL, 15));
    INVALID(urlsph_set_convection(s, side, NULL, 0, NULL, 0));
    INVALID(urlsph_set_convection(s, back, values, 1, values, 1));
    INVALID(urlsph_set_convection(s, top, values, 1, values, 1));
    INVALID(urlsph_set_convection(s, counts.patches, values, 1, values, 1));
    CHECK(hash(s) == before);
    CHECK(urlsph_destroy(s) == URLSPH_OK);

    /* A body without heat takes none. */
    s = create(NULL, 1);
    CHECK(s);
    urlsph_heat_resultant r;
    INVALID(urlsph_set_heat_flux(s, patch(s, "top"), values, 1));
    INVALID(urlsph_set_temperature(s, patch(s, "top"), values, 1));
    INVALID(urlsph_set_convection(s, patch(s, "top"), values, 1, values, 1));
    INVALID(urlsph_get_heat_resultant(s, patch(s, "top"), &r, sizeof r));
    CHECK(strstr(last(s).text, "`heat`") && strcmp(last(s).boundary, "top") == 0);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* What heat and plastic flow do: resultants, probes, fields, ledger. */
static void heat_and_metal(void) {
    urlsph_simulation *s = create_from(metal_path, NULL, 2);
    CHECK(s);
    const size_t top = patch(s, "top"), side = patch(s, "side"), bottom = patch(s, "bottom");
    const double flux = 1e9, hot = 400.0, coefficient = 1e6, air = 600.0;
    const double pull[3] = {0.0, 1.5e8, 0.0};
    CHECK(urlsph_set_traction(s, top, pull, 3) == URLSPH_OK);
    CHECK(urlsph_set_heat_flux(s, top, &flux, 1) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, side, &coefficient, 1, &air, 1) == URLSPH_OK);
    CHECK(urlsph_set_temperature(s, bottom, &hot, 1) == URLSPH_OK);

    /* At once: flux x area, and coefficient x difference x area of a body at 298 K. */
    urlsph_heat_resultant r;
    CHECK(urlsph_get_heat_resultant(s, top, &r, sizeof r) == URLSPH_OK);
    CHECK_NEAR(r.heat_flow, 1e9 * 1e-6, 1e-9);
    CHECK_NEAR(r.mean_temperature, 298.0, 1e-9);
    CHECK_NEAR(r.maximum_temperature, 298.0, 1e-9);
    CHECK(urlsph_get_heat_resultant(s, side, &r, sizeof r) == URLSPH_OK);
    CHECK_NEAR(r.heat_flow, 1e6 * (600.0 - 298.0) * 2e-6, 1e-6);
    INVALID(urlsph_get_heat_resultant(s, SIZE_MAX, &r, sizeof r));

    CHECK(urlsph_step(s, 1e-6) == URLSPH_OK);
    CHECK(urlsph_get_heat_resultant(s, bottom, &r, sizeof r) == URLSPH_OK);
    CHECK_NEAR(r.mean_temperature, 400.0, 1e-9);
    CHECK_NEAR(r.maximum_temperature, 400.0, 1e-9);
    CHECK(urlsph_get_heat_resultant(s, top, &r, sizeof r) == URLSPH_OK);
    CHECK(r.mean_temperature > 298.5 && r.maximum_temperature >= r.mean_temperature);

    urlsph_probe_motion corner;
    size_t probe;
    double temperature[45], strain[45], entropy[45];
    CHECK(urlsph_find_probe(s, "corner", &probe) == URLSPH_OK);
    CHECK(urlsph_get_probe_motion(s, probe, &corner, sizeof corner) == URLSPH_OK);
    CHECK(urlsph_read_field(s, field(s, "temperature"), temperature, 45) == URLSPH_OK);
    CHECK(urlsph_read_field(s, field(s, "equivalent_plastic_strain"), strain, 45) == URLSPH_OK);
    CHECK(urlsph_read_field(s, field(s, "entropy"), entropy, 45) == URLSPH_OK);
    double most = 0.0, nearest = 1e9;
    for (int i = 0; i < 45; ++i) {
        CHECK(temperature[i] > 280.0 && temperature[i] < 700.0 && isfinite(entropy[i]));
        CHECK(strain[i] >= 0.0);
        most = fmax(most, strain[i]);
        nearest = fmin(nearest, fabs(temperature[i] - corner.temperature));
    }
    printf("    largest plastic strain %.3e\n", most);
    CHECK(most > 1e-4);
    /* The corner is a particle. */
    CHECK(nearest < 1e-9);

    urlsph_energies e;
    CHECK(urlsph_get_energies(s, &e, sizeof e) == URLSPH_OK);
    CHECK(e.thermal > 0.0 && e.heat_in > 0.0 && e.plastic_work > 0.0);
    CHECK(e.entropy > 0.0 && e.entropy_production > 0.0 && isfinite(e.ballistic));
    printf("    closure error %.1e of the heat supplied, tolerance 1e-2\n",
           fabs(e.closure_error) / e.heat_in);
    CHECK_NEAR(e.closure_error, 0.0, 1e-2 * e.heat_in);
    CHECK(urlsph_destroy(s) == URLSPH_OK);

    /* A body without heat has no temperature. */
    s = create(NULL, 1);
    CHECK(s && urlsph_find_probe(s, "corner", &probe) == URLSPH_OK);
    CHECK(urlsph_get_probe_motion(s, probe, &corner, sizeof corner) == URLSPH_OK);
    CHECK(corner.temperature == 0.0);
    CHECK(urlsph_get_energies(s, &e, sizeof e) == URLSPH_OK);
    CHECK(e.thermal == 0.0 && e.heat_in == 0.0 && e.plastic_work == 0.0 && e.entropy == 0.0);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* A snapshot has temperatures, plastic strains and inputs for heat: the same bits from there on. */
static void heat_snapshots(void) {
    urlsph_simulation *s = create_from(metal_path, NULL, 2);
    CHECK(s);
    const size_t top = patch(s, "top"), side = patch(s, "side"), bottom = patch(s, "bottom");
    const double pull[3] = {0.0, 1.5e8, 0.0}, push[3] = {0.0, -1.5e8, 1e8};
    const double flux[9] = {1e9, 2e9, 3e9, 4e9, 5e9, 6e9, 7e9, 8e9, 9e9}, none = 0.0;
    const double hot = 400.0, hotter = 500.0, coefficient = 1e6, air = 600.0;
    CHECK(urlsph_set_traction(s, top, pull, 3) == URLSPH_OK);
    CHECK(urlsph_set_heat_flux(s, top, flux, 9) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, side, &coefficient, 1, &air, 1) == URLSPH_OK);
    CHECK(urlsph_set_temperature(s, bottom, &hot, 1) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-6) == URLSPH_OK);
    size_t size, written;
    CHECK(urlsph_get_snapshot_size(s, &size) == URLSPH_OK);
    uint8_t *bytes = malloc(size);
    CHECK(bytes && urlsph_save_snapshot(s, bytes, size, &written) == URLSPH_OK);
    const uint64_t saved = hash(s);
    urlsph_energies then, now;
    urlsph_heat_resultant flow, again;
    CHECK(urlsph_step(s, 1e-6) == URLSPH_OK);
    const uint64_t there = hash(s);
    CHECK(urlsph_get_energies(s, &then, sizeof then) == URLSPH_OK);
    CHECK(urlsph_get_heat_resultant(s, side, &flow, sizeof flow) == URLSPH_OK);

    /* Away with other loads and other heat, and back; and into a twin with other threads. */
    CHECK(urlsph_set_traction(s, top, push, 3) == URLSPH_OK);
    CHECK(urlsph_set_heat_flux(s, top, &none, 1) == URLSPH_OK);
    CHECK(urlsph_set_temperature(s, bottom, &hotter, 1) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, side, &none, 1, &hot, 1) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-6) == URLSPH_OK && hash(s) != there);
    urlsph_simulation *twin = create_from(metal_path, NULL, 3);
    CHECK(twin);
    urlsph_simulation *const both[2] = {s, twin};
    for (int i = 0; i < 2; ++i) {
        CHECK(urlsph_restore_snapshot(both[i], bytes, size) == URLSPH_OK && hash(both[i]) == saved);
        CHECK(urlsph_step(both[i], 1e-6) == URLSPH_OK && hash(both[i]) == there);
        CHECK(urlsph_get_energies(both[i], &now, sizeof now) == URLSPH_OK);
        CHECK(memcmp(&then, &now, sizeof now) == 0);
        CHECK(urlsph_get_heat_resultant(both[i], side, &again, sizeof again) == URLSPH_OK);
        CHECK(memcmp(&flow, &again, sizeof again) == 0);
    }
    free(bytes);
    CHECK(urlsph_destroy(twin) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void time_step(void) {
    urlsph_simulation *s = create(NULL, 2);
    CHECK(s);
    double time, end, dt;
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time == 0.0);
    CHECK(urlsph_get_end_time(s, &end) == URLSPH_OK && end == 0.01);
    CHECK(urlsph_get_stable_step(s, &dt) == URLSPH_OK && dt > 0.0 && dt < 1.0);

    /* Many stable steps, a fraction of one, and exactly the end that was asked for. */
    CHECK(urlsph_step(s, 0.1) == URLSPH_OK);
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time == 0.1);
    urlsph_counts counts;
    CHECK(urlsph_get_counts(s, &counts, sizeof counts) == URLSPH_OK && counts.steps > 2);
    CHECK(urlsph_step(s, 0.3 * dt) == URLSPH_OK);
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time == 0.1 + 0.3 * dt);
    CHECK(urlsph_advance_to(s, 0.107) == URLSPH_OK);
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time == 0.107);

    const uint64_t before = hash(s);
    INVALID(urlsph_step(s, 0.0));
    INVALID(urlsph_step(s, -1e-3));
    INVALID(urlsph_step(s, nan_));
    INVALID(urlsph_step(s, inf_));
    INVALID(urlsph_step(s, 1e-30));
    CHECK(last(s).has_time && last(s).time == 0.107);
    INVALID(urlsph_advance_to(s, 0.107));
    INVALID(urlsph_advance_to(s, 0.0));
    INVALID(urlsph_advance_to(s, nan_));
    INVALID(urlsph_advance_to(s, inf_));
    INVALID(urlsph_advance_to(s, -inf_));
    CHECK(hash(s) == before);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void resultants(void) {
    urlsph_simulation *s = create(NULL, 2);
    CHECK(s);
    const size_t top = patch(s, "top");
    const double pull[3] = {1e4, 0.0, -3e3};
    CHECK(urlsph_set_traction(s, top, pull, 3) == URLSPH_OK);
    CHECK(urlsph_step(s, 2e-3) == URLSPH_OK);
    urlsph_resultant r;
    CHECK(urlsph_get_resultant(s, top, &r, sizeof r) == URLSPH_OK);
    /* A dead traction on 1 m^2. */
    CHECK_NEAR(r.force[0], 1e4, 1e-8);
    CHECK_NEAR(r.force[1], 0.0, 1e-8);
    CHECK_NEAR(r.force[2], -3e3, 1e-8);
    CHECK(r.mean_displacement[0] > 0.0 && r.mean_velocity[0] > 0.0);

    size_t corner;
    CHECK(urlsph_find_probe(s, "corner", &corner) == URLSPH_OK);
    urlsph_probe_info info;
    CHECK(urlsph_get_probe_info(s, corner, &info, sizeof info) == URLSPH_OK);
    CHECK(strcmp(info.name, "corner") == 0 && info.position[1] == 2.0);
    urlsph_probe_motion m;
    CHECK(urlsph_get_probe_motion(s, corner, &m, sizeof m) == URLSPH_OK);
    CHECK(m.displacement[0] > 0.0 && m.velocity[0] > 0.0);
    INVALID(urlsph_get_probe_info(s, 2, &info, sizeof info));
    INVALID(urlsph_get_probe_motion(s, SIZE_MAX, &m, sizeof m));
    INVALID(urlsph_find_probe(s, "center", &corner));
    CHECK(strstr(last(s).text, "middle"));

    urlsph_energies e;
    urlsph_momenta p;
    CHECK(urlsph_get_energies(s, &e, sizeof e) == URLSPH_OK);
    CHECK(e.kinetic > 0.0 && e.strain > 0.0 && e.external_work > 0.0);
    CHECK(e.numerical_dissipation >= 0.0);
    CHECK_NEAR(e.closure_error, 0.0, 1e-2 * e.external_work);
    CHECK(urlsph_get_momenta(s, &p, sizeof p) == URLSPH_OK);
    CHECK(p.linear[0] > 0.0 && isfinite(p.angular[2]));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* A block falls onto a floor, and a piston comes down on it. */
static void contact(void) {
    urlsph_simulation *s = create_from(contact_path, NULL, 2);
    CHECK(s);
    urlsph_counts counts;
    CHECK(urlsph_get_counts(s, &counts, sizeof counts) == URLSPH_OK && counts.contacts == 2);
    size_t floor_ = SIZE_MAX, piston = SIZE_MAX, none = SIZE_MAX;
    CHECK(urlsph_find_contact(s, "floor", &floor_) == URLSPH_OK);
    CHECK(urlsph_find_contact(s, "piston", &piston) == URLSPH_OK && piston != floor_);
    urlsph_contact_info info;
    CHECK(urlsph_get_contact_info(s, piston, &info, sizeof info) == URLSPH_OK);
    CHECK(strcmp(info.name, "piston") == 0 && info.point[1] == 2.001 && info.normal[1] == -1.0);
    CHECK(urlsph_get_contact_info(s, floor_, &info, sizeof info) == URLSPH_OK);
    /* The scene's normal is twice as long. */
    CHECK(strcmp(info.name, "floor") == 0 && info.point[1] == 0.0 && info.normal[1] == 1.0);
    INVALID(urlsph_find_contact(s, "wall", &none));
    CHECK(strstr(last(s).text, "floor, piston"));
    INVALID(urlsph_find_contact(s, NULL, &none));
    INVALID(urlsph_find_contact(s, "floor", NULL));
    urlsph_contact_resultant f, p, again;
    INVALID(urlsph_get_contact_info(s, 2, &info, sizeof info));
    INVALID(urlsph_get_contact_resultant(s, SIZE_MAX, &f, sizeof f));
    CHECK(strstr(last(s).text, "plane of contact"));

    /* The floor stops the lowest layer at once, a quarter of a metre of 1100 kg/m^3 at 1 m/s. */
    CHECK(urlsph_get_contact_resultant(s, floor_, &f, sizeof f) == URLSPH_OK);
    CHECK(urlsph_get_contact_resultant(s, piston, &p, sizeof p) == URLSPH_OK);
    CHECK(f.particles == 9 && f.displacement == 0.0 && p.particles == 0 && p.displacement == 0.0);
    CHECK_NEAR(f.impulse[1], 275.0, 1e-10);
    CHECK(f.impulse[0] == 0.0 && f.impulse[2] == 0.0 && p.impulse[1] == 0.0 && p.force[1] == 0.0);

    /* Nothing but the two planes changes the momentum of 2200 kg at -1 m/s. */
    CHECK(urlsph_step(s, 4e-3) == URLSPH_OK);
    urlsph_momenta m;
    CHECK(urlsph_get_momenta(s, &m, sizeof m) == URLSPH_OK);
    CHECK(urlsph_get_contact_resultant(s, floor_, &f, sizeof f) == URLSPH_OK);
    CHECK(urlsph_get_contact_resultant(s, piston, &p, sizeof p) == URLSPH_OK);
    const double missing = f.impulse[1] + p.impulse[1] - (m.linear[1] + 2200.0);
    CHECK_NEAR(missing, 0.0, 1e-8);
    CHECK(f.particles == 9 && f.force[1] > 0.0 && f.force[0] == 0.0);
    CHECK(p.particles == 9 && p.impulse[1] < 0.0 && p.force[1] < 0.0);
    CHECK_NEAR(p.displacement, 8e-3, 1e-15);
    /* The totals are part of the state. */
    size_t size, written;
    CHECK(urlsph_get_snapshot_size(s, &size) == URLSPH_OK);
    uint8_t *bytes = malloc(size);
    CHECK(bytes && urlsph_save_snapshot(s, bytes, size, &written) == URLSPH_OK);
    const double before = p.impulse[1], dt = 1e-6;
    CHECK(urlsph_step(s, dt) == URLSPH_OK);
    CHECK(urlsph_get_contact_resultant(s, piston, &again, sizeof again) == URLSPH_OK);
    /* The force is the rate of the impulse. */
    const double rate = (again.impulse[1] - before) / dt;
    CHECK_NEAR(rate / p.force[1], 1.0, 1e-3);
    CHECK(urlsph_restore_snapshot(s, bytes, size) == URLSPH_OK);
    CHECK(urlsph_get_contact_resultant(s, piston, &again, sizeof again) == URLSPH_OK);
    CHECK(memcmp(&p, &again, sizeof p) == 0);
    free(bytes);
    CHECK(urlsph_destroy(s) == URLSPH_OK);

    /* A scene without planes. */
    s = create(NULL, 1);
    CHECK(s && urlsph_get_counts(s, &counts, sizeof counts) == URLSPH_OK && counts.contacts == 0);
    INVALID(urlsph_find_contact(s, "floor", &none));
    CHECK(strstr(last(s).text, "none"));
    INVALID(urlsph_get_contact_info(s, 0, &info, sizeof info));
    INVALID(urlsph_get_contact_resultant(s, 0, &f, sizeof f));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void snapshots(void) {
    urlsph_simulation *s = create(NULL, 2), *other = create("material.neo_hookean.poisson_ratio=0.21", 1);
    CHECK(s && other);
    const double pull[3] = {1e4, 0.0, 0.0}, push[3] = {-5e4, 0.0, 0.0};
    const size_t top = patch(s, "top");
    CHECK(urlsph_set_traction(s, top, pull, 3) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);

    size_t size, written = 0;
    CHECK(urlsph_get_snapshot_size(s, &size) == URLSPH_OK && size > 0);
    uint8_t *bytes = malloc(size + 1);
    CHECK(bytes);
    bytes[size] = 77;
    INVALID(urlsph_save_snapshot(s, bytes, size - 1, &written));
    INVALID(urlsph_save_snapshot(s, bytes, 0, &written));
    CHECK(written == 0);
    CHECK(urlsph_save_snapshot(s, bytes, size + 1, &written) == URLSPH_OK);
    CHECK(written == size && bytes[size] == 77);
    const uint64_t saved = hash(s);

    /* Away, with another input, and back. */
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    const uint64_t once = hash(s);
    CHECK(urlsph_set_traction(s, top, push, 3) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    CHECK(urlsph_restore_snapshot(s, bytes, size) == URLSPH_OK);
    CHECK(hash(s) == saved);
    double time;
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time == 1e-3);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    CHECK(hash(s) == once);

    /* The size that was asked for is that of the state at the copy. */
    CHECK(urlsph_get_snapshot_size(s, &size) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-4) == URLSPH_OK);
    uint8_t *late = malloc(size);
    CHECK(late);
    CHECK(urlsph_save_snapshot(s, late, size, &written) == URLSPH_OK);
    const uint64_t there = hash(s);
    CHECK(urlsph_restore_snapshot(s, bytes, written) == URLSPH_OK);
    CHECK(urlsph_restore_snapshot(s, late, written) == URLSPH_OK);
    CHECK(hash(s) == there);
    free(late);

    /* Into another simulation of the same scene, with another number of threads. */
    urlsph_simulation *twin = create(NULL, 3);
    CHECK(twin);
    CHECK(urlsph_restore_snapshot(twin, bytes, size) == URLSPH_OK);
    CHECK(urlsph_step(twin, 1e-3) == URLSPH_OK);
    CHECK(hash(twin) == once);
    CHECK(urlsph_destroy(twin) == URLSPH_OK);

    /* Not a usable snapshot: nothing happens. */
    const uint64_t before = hash(s);
    FAILS(urlsph_restore_snapshot(s, bytes, 0), URLSPH_SNAPSHOT);
    FAILS(urlsph_restore_snapshot(s, NULL, 0), URLSPH_SNAPSHOT);
    FAILS(urlsph_restore_snapshot(s, bytes, 7), URLSPH_SNAPSHOT);
    FAILS(urlsph_restore_snapshot(s, bytes, size - 1), URLSPH_SNAPSHOT);
    FAILS(urlsph_restore_snapshot(s, bytes, size + 1), URLSPH_SNAPSHOT);
    for (size_t i = 0; i < size; i += 97) {
        bytes[i] ^= 0x10;
        FAILS(urlsph_restore_snapshot(s, bytes, size), URLSPH_SNAPSHOT);
        bytes[i] ^= 0x10;
    }
    CHECK(hash(s) == before);
    CHECK(urlsph_restore_snapshot(other, bytes, size) == URLSPH_SNAPSHOT);
    CHECK(last(other).code == URLSPH_SNAPSHOT);
    free(bytes);
    CHECK(urlsph_destroy(other) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* What is in a folder, beside itself and the one above. */
static size_t files_in(const char *folder) {
    DIR *open = opendir(folder);
    if (!open) return SIZE_MAX;
    size_t count = 0;
    while (readdir(open)) ++count;
    closedir(open);
    return count - 2;
}

static void snapshot_files(void) {
    urlsph_simulation *s = create(NULL, 2), *twin = create(NULL, 1);
    urlsph_simulation *other = create("material.neo_hookean.poisson_ratio=0.21", 1);
    CHECK(s && twin && other);
    char folder[] = "/tmp/urlsph-XXXXXX", path[64], part[80], below[64];
    CHECK(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/s.snapshot", folder);
    snprintf(part, sizeof part, "%s.part", path);
    snprintf(below, sizeof below, "%s/nowhere/s.snapshot", folder);

    /* The file has the bytes of the copy, and another simulation goes on from it. */
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    CHECK(urlsph_save_snapshot_to_file(s, path) == URLSPH_OK && files_in(folder) == 1);
    const uint64_t saved = hash(s);
    size_t size, written;
    CHECK(urlsph_get_snapshot_size(s, &size) == URLSPH_OK);
    uint8_t *bytes = malloc(size), *stored = malloc(size + 1);
    CHECK(bytes && stored && urlsph_save_snapshot(s, bytes, size, &written) == URLSPH_OK);
    FILE *file = fopen(path, "rb");
    CHECK(file && fread(stored, 1, size + 1, file) == size);
    CHECK(fclose(file) == 0 && memcmp(bytes, stored, size) == 0);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    const uint64_t once = hash(s);
    CHECK(urlsph_restore_snapshot_from_file(twin, path) == URLSPH_OK && hash(twin) == saved);
    CHECK(urlsph_step(twin, 1e-3) == URLSPH_OK && hash(twin) == once);

    /* What cannot be read leaves the state; what cannot be written leaves the folder, too. */
    FAILS(urlsph_restore_snapshot_from_file(s, below), URLSPH_IO);
    CHECK(strstr(last(s).text, below));
    FAILS(urlsph_restore_snapshot_from_file(s, folder), URLSPH_IO);
    FAILS(urlsph_restore_snapshot_from_file(s, scene_path), URLSPH_SNAPSHOT);
    INVALID(urlsph_restore_snapshot_from_file(s, "\xff"));
    CHECK(urlsph_restore_snapshot_from_file(other, path) == URLSPH_SNAPSHOT);
    FAILS(urlsph_save_snapshot_to_file(s, below), URLSPH_IO);
    CHECK(strstr(last(s).text, below));
    FAILS(urlsph_save_snapshot_to_file(s, folder), URLSPH_IO);
    FAILS(urlsph_save_snapshot_to_file(s, ""), URLSPH_IO);
    INVALID(urlsph_save_snapshot_to_file(s, "\xff"));
    CHECK(files_in(folder) == 1 && hash(s) == once);

    /* A full disk: the snapshot that was there stays, and one that was not does not come. */
    if (access("/dev/full", W_OK) == 0) {
        CHECK(symlink("/dev/full", part) == 0);
        FAILS(urlsph_save_snapshot_to_file(s, path), URLSPH_IO);
        printf("    %s\n", last(s).text);
        CHECK(files_in(folder) == 1 && hash(s) == once);
        CHECK(urlsph_restore_snapshot_from_file(twin, path) == URLSPH_OK && hash(twin) == saved);
        CHECK(unlink(path) == 0 && symlink("/dev/full", part) == 0);
        FAILS(urlsph_save_snapshot_to_file(s, path), URLSPH_IO);
        CHECK(files_in(folder) == 0 && hash(s) == once);
    }

    /* And the simulation goes on as if nothing had been. */
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK && urlsph_save_snapshot_to_file(s, path) == URLSPH_OK);
    CHECK(urlsph_restore_snapshot(twin, bytes, size) == URLSPH_OK);
    CHECK(urlsph_step(twin, 1e-3) == URLSPH_OK && urlsph_step(twin, 1e-3) == URLSPH_OK);
    CHECK(hash(twin) == hash(s));
    CHECK(unlink(path) == 0 && rmdir(folder) == 0);
    free(bytes);
    free(stored);
    CHECK(urlsph_destroy(other) == URLSPH_OK);
    CHECK(urlsph_destroy(twin) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* What the callbacks of a test share. */
struct witness {
    urlsph_simulation *s;
    pthread_t thread;
    int progress, asked, errors, infos, cancel_at;
    bool wrong_thread, wrong_order, not_busy;
    double time, end, start;
    /* The latest record, whose pointers are of the past, and the code of the latest error. */
    urlsph_log_record last;
    urlsph_status code;
};

static void on_log(const urlsph_log_record *record, void *user_data) {
    struct witness *w = user_data;
    if (!pthread_equal(pthread_self(), w->thread)) w->wrong_thread = true;
    const bool failed = record->level == URLSPH_LOG_ERROR;
    if (strlen(record->message) > 0) ++*(failed ? &w->errors : &w->infos);
    w->last = *record;
    if (record->error) w->code = record->error->code;
}

static void on_progress(const urlsph_progress *p, void *user_data) {
    struct witness *w = user_data;
    ++w->progress;
    if (!pthread_equal(pthread_self(), w->thread)) w->wrong_thread = true;
    if (!(p->time > w->time && p->dt > 0.0 && p->steps == (uint64_t)w->progress)) {
        w->wrong_order = true;
    }
    w->time = p->time;
    w->end = p->end;
    w->start = p->start;
    if (p->reference_updates != 0) w->wrong_order = true;
    if (w->progress == 1 && !(all_give(w->s, URLSPH_BUSY) && urlsph_destroy(w->s) == URLSPH_BUSY)) {
        w->not_busy = true;
    }
}

static int32_t on_cancel(void *user_data) {
    struct witness *w = user_data;
    if (!pthread_equal(pthread_self(), w->thread)) w->wrong_thread = true;
    return ++w->asked == w->cancel_at;
}

static void callbacks(void) {
    urlsph_simulation *s = create(NULL, 3), *quiet = create(NULL, 3);
    CHECK(s && quiet);
    struct witness w = {0};
    w.s = s;
    w.thread = pthread_self();
    urlsph_callbacks c = {0};
    c.user_data = &w;
    c.log = on_log;
    c.progress = on_progress;
    c.cancel = on_cancel;
    INVALID(urlsph_set_callbacks(s, &c, 0));
    INVALID(urlsph_set_callbacks(s, &c, sizeof c - 1 - sizeof c.cancel));
    CHECK(urlsph_set_callbacks(s, &c, sizeof c) == URLSPH_OK);

    double dt;
    CHECK(urlsph_get_stable_step(s, &dt) == URLSPH_OK);
    const double end = 20.5 * dt;
    CHECK(urlsph_advance_to(s, end) == URLSPH_OK);
    CHECK(w.progress > 20 && w.asked == w.progress && w.time == end && w.end == end);
    CHECK(!w.wrong_thread && !w.wrong_order && !w.not_busy);
    CHECK(w.infos == 1 && w.errors == 0);
    CHECK(w.last.level == URLSPH_LOG_INFO && w.last.event == URLSPH_EVENT_ADVANCED);
    CHECK(w.last.error == NULL && w.last.time == end && w.last.steps == (uint64_t)w.progress);

    /* Watching changes nothing. */
    CHECK(urlsph_advance_to(quiet, end) == URLSPH_OK);
    CHECK(hash(s) == hash(quiet));

    /* Cancelled after a step that stays; then on as if nothing had been, to the bit. */
    w.cancel_at = w.asked + 2;
    FAILS(urlsph_step(s, 100 * dt), URLSPH_CANCELLED);
    CHECK(w.asked == w.cancel_at && w.errors == 1 && w.start == end);
    CHECK(w.last.event == URLSPH_EVENT_FAILED && w.last.error && w.code == URLSPH_CANCELLED);
    CHECK(w.last.time == w.time && w.last.steps == (uint64_t)w.progress);
    double time;
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK);
    CHECK(time == w.time && time > end && time < end + 3 * dt);
    CHECK(urlsph_step(s, dt) == URLSPH_OK);

    /* Without callbacks again. */
    const int progress = w.progress;
    CHECK(urlsph_set_callbacks(s, NULL, 0) == URLSPH_OK);
    CHECK(urlsph_step(s, dt) == URLSPH_OK);
    CHECK(urlsph_step(s, -1.0) == URLSPH_INVALID_ARGUMENT);
    CHECK(w.progress == progress && w.errors == 1);
    CHECK(urlsph_destroy(quiet) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* A step that goes on until it is told to stop. */
static atomic_bool running, stop;

static void say_running(const urlsph_progress *p, void *user_data) {
    (void)p;
    (void)user_data;
    atomic_store(&running, true);
}

static int32_t ask_stop(void *user_data) {
    (void)user_data;
    return atomic_load(&stop);
}

static void *endless(void *handle) {
    const urlsph_status status = urlsph_advance_to(handle, 1e9);
    atomic_store(&running, true);
    return status == URLSPH_CANCELLED ? NULL : handle;
}

static void busy(void) {
    urlsph_simulation *s = create(NULL, 2), *free_ = create(NULL, 1);
    CHECK(s && free_);
    urlsph_callbacks c = {0};
    c.progress = say_running;
    c.cancel = ask_stop;
    CHECK(urlsph_set_callbacks(s, &c, sizeof c) == URLSPH_OK);
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, endless, s) == 0);
    while (!atomic_load(&running)) {
    }
    const bool all_busy = all_give(s, URLSPH_BUSY);
    const urlsph_status destroyed = urlsph_destroy(s);
    urlsph_error e;
    const urlsph_status asked = urlsph_get_last_error(s, &e, sizeof e);
    /* Another simulation does not notice. */
    const bool other_works = all_give(free_, URLSPH_OK);
    atomic_store(&stop, true);
    void *failed;
    CHECK(pthread_join(thread, &failed) == 0);
    CHECK(failed == NULL);
    CHECK(all_busy && destroyed == URLSPH_BUSY && asked == URLSPH_BUSY && other_works);
    CHECK(last(s).code == URLSPH_CANCELLED);
    CHECK(all_give(s, URLSPH_OK));
    CHECK(urlsph_destroy(free_) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

/* Threads that all want the same handle, or create and destroy their own, and one that destroys. */
static _Atomic(urlsph_simulation *) shared;

static void *hammer(void *unused) {
    (void)unused;
    for (int i = 0; i < 200; ++i) {
        urlsph_simulation *s = atomic_load(&shared);
        double time;
        urlsph_status status = i % 10 ? urlsph_get_time(s, &time) : urlsph_step(s, 1e-5);
        if (status != URLSPH_OK && status != URLSPH_BUSY && status != URLSPH_INVALID_ARGUMENT) {
            return &shared;
        }
    }
    return NULL;
}

static void *replace(void *unused) {
    (void)unused;
    for (int i = 0; i < 20; ++i) {
        urlsph_simulation *next = create(NULL, 1);
        urlsph_simulation *old = atomic_exchange(&shared, next);
        urlsph_status status;
        while ((status = urlsph_destroy(old)) == URLSPH_BUSY) {
        }
        if (!next || status != URLSPH_OK) return &shared;
    }
    return NULL;
}

static void many_threads(void) {
    atomic_store(&shared, create(NULL, 1));
    pthread_t threads[5];
    for (int i = 0; i < 5; ++i) {
        CHECK(pthread_create(&threads[i], NULL, i ? hammer : replace, NULL) == 0);
    }
    bool failed = false;
    for (int i = 0; i < 5; ++i) {
        void *outcome;
        CHECK(pthread_join(threads[i], &outcome) == 0);
        failed = failed || outcome;
    }
    CHECK(!failed);
    CHECK(urlsph_destroy(atomic_load(&shared)) == URLSPH_OK);
}

static void number_of_threads(void) {
    uint64_t first = 0;
    const size_t threads[] = {1, 2, 3, 8};
    for (int i = 0; i < 4; ++i) {
        urlsph_simulation *s = create("geometry.box.spacing=0.125", threads[i]);
        CHECK(s);
        const double pull[3] = {1e5, 0.0, 0.0};
        CHECK(urlsph_set_traction(s, patch(s, "top"), pull, 3) == URLSPH_OK);
        CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
        if (i == 0) first = hash(s);
        CHECK(hash(s) == first);
        CHECK(urlsph_destroy(s) == URLSPH_OK);
    }
}

/* Threads of this process; 0 where nobody tells. */
static size_t threads_now(void) {
    DIR *folder = opendir("/proc/self/task");
    if (!folder) return 0;
    size_t count = 0;
    while (readdir(folder)) ++count;
    closedir(folder);
    return count;
}

/* A host may unload the library right after the last simulation: no thread may be left in its code. */
static void threads_end(void) {
    const size_t before = threads_now();
    for (int i = 0; i < 20; ++i) {
        urlsph_simulation *s = create(NULL, 8);
        CHECK(s && urlsph_step(s, 1e-5) == URLSPH_OK);
        CHECK(before == 0 || threads_now() == before + 8);
        CHECK(urlsph_destroy(s) == URLSPH_OK);
        /* The kernel may list a thread for a moment after it was waited for. */
        const struct timespec moment = {0, 1000000};
        for (int wait = 0; wait < 1000 && threads_now() != before; ++wait) nanosleep(&moment, NULL);
        CHECK(threads_now() == before);
    }
}

static void divergence(void) {
    urlsph_simulation *s = create(NULL, 2);
    CHECK(s);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    /* Pulls the column apart in a step or two. */
    const double pull[27] = {[0] = 1e14, [13] = -1e14};
    CHECK(urlsph_set_traction(s, patch(s, "top"), pull, 27) == URLSPH_OK);
    FAILS(urlsph_step(s, 1.0), URLSPH_DIVERGED);
    const urlsph_error e = last(s);
    printf("    %s\n", e.text);
    CHECK(e.has_particle && e.particle < 45);
    CHECK(e.has_position && isfinite(e.position[0]));
    CHECK(e.has_time && e.time >= 1e-3);
    CHECK(e.field[0] != 0);

    /* The last good state can be read. */
    double values[405], time;
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time >= 1e-3 && time < 1.0);
    CHECK(urlsph_read_field(s, field(s, "cauchy_stress"), values, 405) == URLSPH_OK);
    for (int i = 0; i < 405; ++i) CHECK(isfinite(values[i]));
    CHECK(all_give(s, URLSPH_OK));
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

int main(int argc, char **argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: %s SCENE.json METAL.json CONTACT.json\n", argv[0]);
        return 2;
    }
    scene_path = argv[1];
    metal_path = argv[2];
    contact_path = argv[3];
    RUN(versions);
    RUN(creation_from_text);
    RUN(creation_fails);
    RUN(handles);
    RUN(null_outputs);
    RUN(struct_sizes);
    RUN(patches);
    RUN(fields);
    RUN(inputs);
    RUN(heat_inputs);
    RUN(heat_and_metal);
    RUN(heat_snapshots);
    RUN(time_step);
    RUN(resultants);
    RUN(contact);
    RUN(snapshots);
    RUN(snapshot_files);
    RUN(callbacks);
    RUN(busy);
    RUN(many_threads);
    RUN(number_of_threads);
    RUN(threads_end);
    RUN(divergence);
    return check_summary();
}
