/* A program of release 0.1.0: with that release's header alone it calls every function and looks into
 * every struct. It stays as it is. */

#include <stdint.h>
#include <stdlib.h>

#include <urlsph.h>

#include "../../check.h"

static const char *scene_path, *file_path;

enum { PARTICLES = 3 * 5 * 3, FACE = 3 * 3, SIDE = 3 * 5 };

/* Asks for a struct, of which the library must not write more than there was in this release. */
#define GET(type, name, function, ...)                                          \
    struct {                                                                    \
        type is;                                                                \
        unsigned char beyond[256];                                              \
    } name##_;                                                                  \
    memset(&name##_, 0x5a, sizeof name##_);                                     \
    CHECK(function(__VA_ARGS__, &name##_.is, sizeof name##_.is) == URLSPH_OK);  \
    for (size_t at = 0; at < 256; ++at) CHECK(name##_.beyond[at] == 0x5a);      \
    const type name = name##_.is

static urlsph_simulation *create(void) {
    const char *overrides[] = {"time.end=0.02"};
    urlsph_options options = {0};
    options.overrides = overrides;
    options.override_count = 1;
    options.threads = 2;
    urlsph_simulation *s = NULL;
    urlsph_error error;
    if (urlsph_create_from_file(scene_path, &options, sizeof options, &s, &error, sizeof error) !=
        URLSPH_OK) {
        printf("    %s\n", error.text);
    }
    return s;
}

static size_t patch(const urlsph_simulation *s, const char *name) {
    size_t index = SIZE_MAX;
    urlsph_find_patch(s, name, &index);
    return index;
}

static size_t field(const urlsph_simulation *s, const char *name) {
    size_t index = SIZE_MAX;
    urlsph_find_field(s, name, &index);
    return index;
}

static uint64_t hash(const urlsph_simulation *s) {
    uint64_t value = 0;
    return urlsph_get_state_hash(s, &value) == URLSPH_OK ? value : 0;
}

static void library(void) {
    CHECK(strlen(urlsph_version()) >= 5);
    CHECK(urlsph_abi_version() == URLSPH_ABI_VERSION);
    for (int32_t status = URLSPH_OK; status <= URLSPH_INTERNAL; ++status) {
        CHECK(strcmp(urlsph_status_text(status), "unknown status") != 0);
    }
}

static void creation(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    const char *title = NULL;
    double end = 0.0;
    CHECK(urlsph_get_title(s, &title) == URLSPH_OK && strcmp(title, "First release") == 0);
    CHECK(urlsph_get_end_time(s, &end) == URLSPH_OK && end == 0.02);
    GET(urlsph_counts, counts, urlsph_get_counts, s);
    CHECK(counts.particles == PARTICLES && counts.pairs > PARTICLES && counts.patches >= 9);
    CHECK(counts.fields > 10 && counts.probes == 1 && counts.inputs == 7 && counts.threads == 2);
    CHECK(counts.steps == 0 && counts.contacts == 1);
    CHECK(urlsph_destroy(s) == URLSPH_OK);

    FILE *file = fopen(scene_path, "rb");
    CHECK(file);
    char json[4096];
    json[fread(json, 1, sizeof json - 1, file)] = 0;
    fclose(file);
    CHECK(urlsph_create_from_json(json, NULL, 0, &s, NULL, 0) == URLSPH_OK);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void errors(void) {
    const char *overrides[] = {"material.neo_hookean.density=-1"};
    const urlsph_options options = {overrides, 1, 1};
    urlsph_simulation *s = NULL;
    struct {
        urlsph_error is;
        unsigned char beyond[256];
    } error;
    memset(&error, 0x5a, sizeof error);
    CHECK(urlsph_create_from_file(scene_path, &options, sizeof options, &s, &error.is,
                                  sizeof error.is) == URLSPH_INVALID_SCENE);
    for (size_t i = 0; i < 256; ++i) CHECK(error.beyond[i] == 0x5a);
    CHECK(!s && error.is.code == URLSPH_INVALID_SCENE && strlen(error.is.text) > 10);
    CHECK(strcmp(error.is.path, "material.neo_hookean.density") == 0);

    /* Pulls the column apart in a step or two. */
    s = create();
    CHECK(s);
    double pull[3 * FACE] = {0.0};
    pull[0] = 1e14;
    pull[13] = -1e14;
    CHECK(urlsph_set_traction(s, patch(s, "top"), pull, 3 * FACE) == URLSPH_OK);
    CHECK(urlsph_step(s, 1.0) == URLSPH_DIVERGED);
    GET(urlsph_error, last, urlsph_get_last_error, s);
    CHECK(last.code == URLSPH_DIVERGED && last.has_time == 1 && last.time >= 0.0);
    CHECK(last.has_particle == 1 && last.particle < PARTICLES && last.field[0] != 0);
    CHECK(last.has_position == 1 && fabs(last.position[0]) < 1e9 && last.boundary[0] == 0);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

struct seen {
    int steps, messages, cancel_after;
    double time, end;
};

static void on_log(const urlsph_log_record *record, void *user_data) {
    struct seen *seen = user_data;
    const int failed = record->event == URLSPH_EVENT_FAILED;
    if (record->level == (failed ? URLSPH_LOG_ERROR : URLSPH_LOG_INFO) && record->message[0] &&
        (record->error != NULL) == failed && (!failed || record->error->code != URLSPH_OK)) {
        ++seen->messages;
    }
}

static void on_progress(const urlsph_progress *progress, void *user_data) {
    struct seen *seen = user_data;
    if (progress->steps == (uint64_t)++seen->steps && progress->dt > 0.0) {
        seen->time = progress->time;
        seen->end = progress->end;
    }
}

static int32_t on_cancel(void *user_data) {
    struct seen *seen = user_data;
    return seen->steps == seen->cancel_after;
}

static void steps(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    struct seen seen = {0};
    const urlsph_callbacks callbacks = {&seen, on_log, on_progress, on_cancel};
    CHECK(urlsph_set_callbacks(s, &callbacks, sizeof callbacks) == URLSPH_OK);
    double dt = 0.0, time = 0.0;
    CHECK(urlsph_get_stable_step(s, &dt) == URLSPH_OK && dt > 0.0);
    CHECK(urlsph_advance_to(s, 3.5 * dt) == URLSPH_OK);
    CHECK(seen.steps >= 4 && seen.messages >= 1);
    CHECK(seen.time == 3.5 * dt && seen.end == 3.5 * dt);
    seen.cancel_after = seen.steps + 1;
    CHECK(urlsph_step(s, 10.0 * dt) == URLSPH_CANCELLED);
    CHECK(urlsph_get_time(s, &time) == URLSPH_OK && time == seen.time);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void patches(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    const size_t top = patch(s, "top");
    GET(urlsph_patch_info, info, urlsph_get_patch_info, s, top);
    CHECK(strcmp(info.name, "top") == 0 && info.particles == FACE);
    CHECK_NEAR(info.area, 1.0, 1e-12);
    size_t particles[FACE];
    double areas[FACE], normals[3 * FACE], sum = 0.0;
    CHECK(urlsph_read_patch_particles(s, top, particles, FACE) == URLSPH_OK);
    CHECK(urlsph_read_patch_areas(s, top, areas, FACE) == URLSPH_OK);
    CHECK(urlsph_read_patch_normals(s, top, normals, 3 * FACE) == URLSPH_OK);
    for (size_t i = 0; i < FACE; ++i) {
        CHECK(particles[i] < PARTICLES && normals[3 * i + 1] == 1.0);
        sum += areas[i];
    }
    CHECK_NEAR(sum, info.area, 1e-12);

    const double pull[3] = {1e3, 2e3, 0.0};
    CHECK(urlsph_set_traction(s, top, pull, 3) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    GET(urlsph_resultant, resultant, urlsph_get_resultant, s, top);
    CHECK_NEAR(resultant.force[0], 1e3, 1e-9);
    CHECK_NEAR(resultant.force[1], 2e3, 1e-9);
    CHECK(resultant.moment[2] < 0.0);
    CHECK(resultant.mean_displacement[1] > 0.0 && resultant.mean_velocity[1] > 0.0);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void inputs(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    int seen[8] = {0};
    for (size_t i = 0; i < 7; ++i) {
        GET(urlsph_input_info, info, urlsph_get_input_info, s, i);
        const int vector = info.quantity == URLSPH_TRACTION || info.quantity == URLSPH_VELOCITY;
        CHECK(info.quantity >= URLSPH_TRACTION && info.quantity <= URLSPH_AMBIENT_TEMPERATURE);
        CHECK(info.components == (vector ? 3 : 1) && info.per_particle == 0);
        CHECK(info.particles == (info.patch == patch(s, "side") ? SIDE : FACE));
        ++seen[info.quantity];
    }
    for (int quantity = URLSPH_TRACTION; quantity <= URLSPH_AMBIENT_TEMPERATURE; ++quantity) {
        CHECK(seen[quantity] == 1);
    }
    const size_t top = patch(s, "top"), side = patch(s, "side"), bottom = patch(s, "bottom");
    const double vector[3] = {0.0, 1.0, 0.0}, flux = 1e5, pressure = 1e3;
    const double hot = 320.0, coefficient = 50.0;
    double back[3 * SIDE] = {0.0};
    size_t count = 0;
    CHECK(urlsph_set_traction(s, top, vector, 3) == URLSPH_OK);
    CHECK(urlsph_set_velocity(s, bottom, vector, 3) == URLSPH_OK);
    CHECK(urlsph_set_pressure(s, side, &pressure, 1) == URLSPH_OK);
    CHECK(urlsph_set_heat_flux(s, top, &flux, 1) == URLSPH_OK);
    CHECK(urlsph_set_temperature(s, bottom, &hot, 1) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, side, &coefficient, 1, &hot, 1) == URLSPH_OK);
    CHECK(urlsph_read_input(s, side, URLSPH_PRESSURE, back, 3 * SIDE, &count) == URLSPH_OK);
    CHECK(count == 1 && back[0] == 1e3);
    CHECK(urlsph_read_input(s, bottom, URLSPH_VELOCITY, back, 3 * SIDE, &count) == URLSPH_OK);
    CHECK(count == 3 && back[1] == 1.0);

    GET(urlsph_heat_resultant, flow, urlsph_get_heat_resultant, s, top);
    CHECK_NEAR(flow.heat_flow, 1e5, 1e-6);
    CHECK_NEAR(flow.mean_temperature, 293.0, 1e-9);
    CHECK_NEAR(flow.maximum_temperature, 293.0, 1e-9);
    GET(urlsph_heat_resultant, convection, urlsph_get_heat_resultant, s, side);
    CHECK_NEAR(convection.heat_flow, 50.0 * (320.0 - 293.0) * 2.0, 1e-6);
    CHECK(urlsph_step(s, 1e-4) == URLSPH_OK);
    GET(urlsph_heat_resultant, held, urlsph_get_heat_resultant, s, bottom);
    CHECK_NEAR(held.mean_temperature, 320.0, 1e-9);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void fields(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    const double pull[3] = {1e3, 2e3, 0.0};
    CHECK(urlsph_set_traction(s, patch(s, "top"), pull, 3) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    const size_t velocity = field(s, "velocity");
    GET(urlsph_field_info, info, urlsph_get_field_info, s, velocity);
    CHECK(strcmp(info.name, "velocity") == 0 && strcmp(info.unit, "m/s") == 0);
    CHECK(info.description[0] && info.components == 3 && info.is_present == 1);
    CHECK(info.configuration == URLSPH_CONFIGURATION_CURRENT && info.has_view == 1);
    GET(urlsph_field_info, gradient, urlsph_get_field_info, s, field(s, "deformation_gradient"));
    CHECK(gradient.components == 9 && gradient.configuration == URLSPH_CONFIGURATION_TWO_POINT);
    GET(urlsph_field_info, strain, urlsph_get_field_info, s, field(s, "equivalent_plastic_strain"));
    CHECK(strain.is_present == 0);

    double values[3 * PARTICLES];
    uint64_t generation = 0;
    CHECK(urlsph_read_field(s, velocity, values, 3 * PARTICLES) == URLSPH_OK);
    GET(urlsph_view, view, urlsph_get_view, s, velocity);
    CHECK(view.particles == PARTICLES && view.components == 3);
    for (size_t slot = 0; slot < PARTICLES; ++slot) {
        for (size_t c = 0; c < 3; ++c) {
            CHECK(view.data[c * view.component_stride + slot] == values[3 * view.order[slot] + c]);
        }
    }
    CHECK(urlsph_get_generation(s, &generation) == URLSPH_OK && generation == view.generation);

    size_t probe = SIZE_MAX;
    CHECK(urlsph_find_probe(s, "corner", &probe) == URLSPH_OK && probe == 0);
    GET(urlsph_probe_info, place, urlsph_get_probe_info, s, probe);
    CHECK(strcmp(place.name, "corner") == 0 && place.position[1] == 2.0);
    GET(urlsph_probe_motion, motion, urlsph_get_probe_motion, s, probe);
    CHECK(motion.displacement[1] > 0.0 && motion.velocity[1] > 0.0);
    CHECK_NEAR(motion.temperature, 293.0, 1.0);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void totals(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    const double pull[3] = {0.0, 1e4, 0.0}, hot = 300.0, coefficient = 50.0;
    CHECK(urlsph_set_traction(s, patch(s, "top"), pull, 3) == URLSPH_OK);
    CHECK(urlsph_set_convection(s, patch(s, "side"), &coefficient, 1, &hot, 1) == URLSPH_OK);
    CHECK(urlsph_step(s, 1e-3) == URLSPH_OK);
    GET(urlsph_energies, e, urlsph_get_energies, s);
    CHECK(e.kinetic > 0.0 && e.strain > 0.0 && e.external_work > 0.0 && e.heat_in > 0.0);
    CHECK(e.numerical_dissipation >= 0.0 && e.projection == 0.0 && e.plastic_work == 0.0);
    CHECK(e.contact_dissipation == 0.0 && e.entropy_production >= 0.0 && e.entropy > 0.0);
    CHECK_NEAR(e.closure_error / e.external_work, 0.0, 0.05);
    CHECK_NEAR((e.kinetic + e.strain + e.thermal - 293.0 * e.entropy) / e.ballistic, 1.0, 1e-9);
    GET(urlsph_momenta, momenta, urlsph_get_momenta, s);
    CHECK_NEAR(momenta.linear[1], 1e4 * 1e-3, 1.0);
    CHECK(momenta.angular[2] > 0.0);

    size_t wall = SIZE_MAX;
    CHECK(urlsph_find_contact(s, "wall", &wall) == URLSPH_OK && wall == 0);
    GET(urlsph_contact_info, plane, urlsph_get_contact_info, s, wall);
    CHECK(strcmp(plane.name, "wall") == 0 && plane.point[0] == -1.0 && plane.normal[0] == 1.0);
    GET(urlsph_contact_resultant, contact, urlsph_get_contact_resultant, s, wall);
    CHECK(contact.force[0] == 0.0 && contact.impulse[0] == 0.0);
    CHECK(contact.displacement == 0.0 && contact.particles == 0);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

static void snapshots(void) {
    urlsph_simulation *s = create();
    CHECK(s);
    size_t size = 0, written = 0;
    CHECK(urlsph_step(s, 1e-4) == URLSPH_OK);
    CHECK(urlsph_get_snapshot_size(s, &size) == URLSPH_OK && size > PARTICLES);
    uint8_t *bytes = malloc(size);
    CHECK(bytes && urlsph_save_snapshot(s, bytes, size, &written) == URLSPH_OK && written == size);
    const uint64_t saved = hash(s);
    CHECK(saved != 0 && urlsph_step(s, 1e-4) == URLSPH_OK && hash(s) != saved);
    CHECK(urlsph_restore_snapshot(s, bytes, size) == URLSPH_OK && hash(s) == saved);
    CHECK(urlsph_step(s, 1e-4) == URLSPH_OK);
    CHECK(urlsph_save_snapshot_to_file(s, file_path) == URLSPH_OK);
    const uint64_t later = hash(s);
    CHECK(urlsph_restore_snapshot(s, bytes, size) == URLSPH_OK && hash(s) == saved);
    CHECK(urlsph_restore_snapshot_from_file(s, file_path) == URLSPH_OK && hash(s) == later);
    CHECK(remove(file_path) == 0);
    CHECK(urlsph_restore_snapshot_from_file(s, file_path) == URLSPH_IO);
    bytes[size / 2] ^= 1;
    CHECK(urlsph_restore_snapshot(s, bytes, size) == URLSPH_SNAPSHOT);
    free(bytes);
    CHECK(urlsph_destroy(s) == URLSPH_OK);
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s SCENE.json FILE\n", argv[0]);
        return 2;
    }
    scene_path = argv[1];
    file_path = argv[2];
    RUN(library);
    RUN(creation);
    RUN(errors);
    RUN(steps);
    RUN(patches);
    RUN(inputs);
    RUN(fields);
    RUN(totals);
    RUN(snapshots);
    return check_summary();
}
