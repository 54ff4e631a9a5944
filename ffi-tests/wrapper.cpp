// The C++17 wrapper: ownership, exceptions, vectors, callbacks that throw, threads.

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include <urlsph.hpp>

#include "check.h"

namespace {

std::string scene_path, metal_path, contact_path;

urlsph::Simulation create(std::size_t threads = 2) {
    urlsph::Options options;
    options.threads = threads;
    return urlsph::Simulation::from_file(scene_path, options);
}

// The error that a call throws, or one with code URLSPH_OK.
template <class F>
urlsph::Error thrown(F f) {
    try {
        f();
    } catch (const urlsph::Error& e) {
        return e;
    }
    return urlsph::Error(URLSPH_OK);
}

void creation() {
    std::ifstream file(scene_path);
    const std::string json((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    const urlsph::Simulation a = urlsph::Simulation::from_json(json);
    const urlsph::Simulation b = create();
    CHECK(a.state_hash() == b.state_hash());
    CHECK(a.title() == "Test column" && a.time() == 0.0 && a.end_time() == 0.01);
    CHECK(b.counts().threads == 2 && b.counts().particles == 45);

    urlsph::Options options;
    options.overrides = {"title=\"Mine\"", "material.neo_hookean.poisson_ratio=0.5"};
    const urlsph::Error e =
        thrown([&] { (void)urlsph::Simulation::from_json(json, options); });
    CHECK(e.code() == URLSPH_INVALID_SCENE);
    CHECK(e.path() == "material.neo_hookean.poisson_ratio");
    CHECK(!e.particle() && !e.position() && !e.time() && e.field().empty());
    CHECK(std::string(e.what()).find("0.5") != std::string::npos);
}

void ownership() {
    urlsph::Simulation a = create();
    urlsph_simulation* const handle = a.handle();
    urlsph::Simulation b = std::move(a);
    CHECK(b.handle() == handle && a.handle() == nullptr);
    CHECK(thrown([&] { (void)a.time(); }).code() == URLSPH_INVALID_ARGUMENT);
    a = create();
    urlsph_simulation* const second = a.handle();
    b = std::move(a);
    CHECK(b.handle() == second);
    double time;
    CHECK(urlsph_get_time(handle, &time) == URLSPH_INVALID_ARGUMENT);
    std::vector<urlsph::Simulation> many;
    for (int i = 0; i < 5; ++i) many.push_back(create(1));
    for (urlsph::Simulation& s : many) s.step(1e-5);
}

void queries() {
    urlsph::Simulation s = create();
    const std::size_t top = s.patch("top");
    CHECK(s.patch_info(top).particles == 9 && std::string(s.patch_info(top).name) == "top");
    CHECK(s.patch_particles(top).size() == 9 && s.patch_areas(top).size() == 9);
    CHECK(s.patch_normals(top).size() == 27 && s.patch_normals(top)[1] == 1.0);

    s.set_traction(top, {1e4, 0.0, 0.0});
    CHECK((s.input(top, URLSPH_TRACTION) == std::vector<double>{1e4, 0.0, 0.0}));
    s.set_traction(top, std::vector<double>(27, 1e3));
    CHECK(s.input(top, URLSPH_TRACTION).size() == 27);
    s.set_pressure(s.patch("side"), 10.0);
    s.set_pressure(s.patch("side"), std::vector<double>(15, 20.0));
    s.set_velocity(s.patch("bottom"), {0.0, 0.1, 0.0});
    const std::array<double, 27> still{};
    s.set_velocity(s.patch("bottom"), urlsph::Span<double>(still));
    const urlsph::Error e = thrown([&] { s.set_traction(top, std::vector<double>(4)); });
    CHECK(e.code() == URLSPH_INVALID_ARGUMENT && e.boundary() == "top");

    s.step(1e-3);
    s.advance_to(2e-3);
    CHECK(s.time() == 2e-3 && s.stable_step() > 0.0);
    CHECK(thrown([&] { s.step(-1.0); }).time().value_or(0.0) == 2e-3);
    CHECK_NEAR(s.resultant(top).force[1], 1e3, 1e-8);
    CHECK(s.energies().kinetic > 0.0 && s.momenta().linear[1] != 0.0);
    CHECK(std::string(s.probe_info(s.probe("corner")).name) == "corner");
    CHECK(s.probe_motion(s.probe("corner")).displacement[1] > 0.0);
    CHECK(s.input_info(0).particles > 0);

    const std::size_t velocity = s.field("velocity");
    CHECK(std::string(s.field_info(velocity).unit) == "m/s");
    const std::vector<double> values = s.read_field("velocity");
    CHECK(values.size() == 135 && values == s.read_field(velocity));
    std::vector<double> mine(200);
    s.read_field(velocity, mine.data(), mine.size());
    CHECK(std::equal(values.begin(), values.end(), mine.begin()));
    const urlsph_view view = s.view(velocity);
    CHECK(view.generation == s.generation());
    CHECK(view.data[0] == values[3 * view.order[0]]);
}

void heat() {
    urlsph::Options options;
    options.threads = 2;
    urlsph::Simulation s = urlsph::Simulation::from_file(metal_path, options);
    const std::size_t top = s.patch("top"), side = s.patch("side"), back = s.patch("back");
    s.set_traction(top, {0.0, 1.5e8, 0.0});
    s.set_heat_flux(top, 1e9);
    s.set_heat_flux(top, std::vector<double>(9, 2e9));
    s.set_temperature(s.patch("bottom"), 400.0);
    s.set_temperature(s.patch("bottom"), std::vector<double>(9, 410.0));
    s.set_convection(side, 1e5, 500.0);
    s.set_convection(side, std::vector<double>(15, 1e6), std::vector<double>{600.0});
    s.set_convection_coefficient(side, 2e6);
    s.set_convection_coefficient(side, std::vector<double>(15, 1e6));
    s.set_ambient_temperature(back, 300.0);
    s.set_ambient_temperature(side, std::vector<double>(15, 600.0));
    CHECK(s.input(side, URLSPH_CONVECTION_COEFFICIENT) == std::vector<double>(15, 1e6));
    CHECK(s.input(back, URLSPH_AMBIENT_TEMPERATURE) == std::vector<double>{300.0});
    CHECK_NEAR(s.heat_resultant(top).heat_flow, 2e3, 1e-8);
    CHECK_NEAR(s.heat_resultant(side).heat_flow, 604.0, 1e-6);
    const urlsph::Error e = thrown([&] { s.set_convection_coefficient(back, 1.0); });
    CHECK(e.code() == URLSPH_INVALID_ARGUMENT && e.boundary() == "back");
    CHECK(thrown([&] { s.set_temperature(s.patch("bottom"), -1.0); }).field() == "temperature");

    s.step(1e-6);
    const std::vector<std::uint8_t> saved = s.snapshot();
    s.step(1e-6);
    const std::uint64_t there = s.state_hash();
    s.restore(saved);
    s.step(1e-6);
    CHECK(s.state_hash() == there);
    CHECK(s.energies().heat_in > 0.0 && s.energies().plastic_work > 0.0);
    CHECK(s.probe_motion(s.probe("corner")).temperature > 298.0);
    CHECK(s.heat_resultant(top).maximum_temperature > 298.0);
    CHECK(s.read_field("temperature").size() == 45);

    urlsph::Simulation cold = create();
    CHECK(cold.field_info(cold.field("temperature")).is_present == 0);
    CHECK(thrown([&] { (void)cold.read_field("temperature"); }).field() == "temperature");
    CHECK(thrown([&] { (void)cold.heat_resultant(0); }).code() == URLSPH_INVALID_ARGUMENT);
}

void contact() {
    urlsph::Simulation s = urlsph::Simulation::from_file(contact_path);
    CHECK(s.counts().contacts == 2);
    const std::size_t floor = s.contact("floor"), piston = s.contact("piston");
    CHECK(std::string(s.contact_info(floor).name) == "floor");
    CHECK(s.contact_info(floor).normal[1] == 1.0 && s.contact_info(piston).point[1] == 2.001);
    CHECK(s.contact_resultant(floor).particles == 9 && s.contact_resultant(piston).particles == 0);
    CHECK_NEAR(s.contact_resultant(floor).impulse[1], 275.0, 1e-10);
    s.step(4e-3);
    const double impulse =
        s.contact_resultant(floor).impulse[1] + s.contact_resultant(piston).impulse[1];
    CHECK_NEAR(impulse, s.momenta().linear[1] + 2200.0, 1e-8);
    CHECK_NEAR(s.contact_resultant(piston).displacement, 8e-3, 1e-15);
    CHECK(s.contact_resultant(piston).force[1] < 0.0 && s.energies().contact_dissipation > 0.0);
    const urlsph::Error e = thrown([&] { (void)s.contact("wall"); });
    CHECK(e.code() == URLSPH_INVALID_ARGUMENT);
    CHECK(std::string(e.what()).find("floor, piston") != std::string::npos);
    CHECK(thrown([&] { (void)s.contact_resultant(2); }).code() == URLSPH_INVALID_ARGUMENT);
}

void snapshots() {
    urlsph::Simulation s = create();
    s.set_traction(s.patch("top"), {1e4, 0.0, 0.0});
    s.step(1e-3);
    const std::vector<std::uint8_t> saved = s.snapshot();
    const std::uint64_t here = s.state_hash();
    s.step(1e-3);
    const std::uint64_t there = s.state_hash();
    s.restore(saved);
    CHECK(s.state_hash() == here && here != there);
    s.step(1e-3);
    CHECK(s.state_hash() == there);
    const urlsph::Error e = thrown(
        [&] { s.restore(std::vector<std::uint8_t>(saved.begin(), saved.end() - 1)); });
    CHECK(e.code() == URLSPH_SNAPSHOT && s.state_hash() == there);

    std::string folder = (std::filesystem::temp_directory_path() / "urlsph-XXXXXX").string();
    CHECK(mkdtemp(folder.data()));
    const std::string path = folder + "/s.snapshot";
    s.save_snapshot(path);
    s.restore(saved);
    s.restore_snapshot(path);
    CHECK(s.state_hash() == there);
    CHECK(std::filesystem::remove(path));
    CHECK(thrown([&] { s.restore_snapshot(path); }).code() == URLSPH_IO);
    CHECK(thrown([&] { s.save_snapshot(path + "/in/it"); }).code() == URLSPH_IO);
    CHECK(s.state_hash() == there);
    CHECK(std::filesystem::remove(folder));
}

void callbacks() {
    urlsph::Simulation s = create();
    const double dt = s.stable_step();
    int progress = 0, asked = 0, logged = 0, cancel_at = 0;
    urlsph::Callbacks c;
    c.log = [&](const urlsph_log_record& record) {
        const bool failed = record.event == URLSPH_EVENT_FAILED;
        CHECK(failed == (record.error != nullptr) && failed == (record.level == URLSPH_LOG_ERROR));
        CHECK(record.message[0] != 0 && record.steps > 0);
        ++logged;
    };
    c.progress = [&](const urlsph_progress& p) {
        ++progress;
        if (p.time > 1.0) throw std::runtime_error("stop here");
    };
    c.cancel = [&] { return ++asked == cancel_at; };
    s.set_callbacks(c);
    s.step(10.5 * dt);
    CHECK(progress > 10 && asked == progress && logged == 1);
    cancel_at = asked + 3;
    CHECK(thrown([&] { s.step(1.0); }).code() == URLSPH_CANCELLED);
    CHECK(asked == cancel_at && logged == 2);

    // The callbacks move with the simulation.
    urlsph::Simulation moved = std::move(s);
    const int before = progress;
    moved.step(dt);
    CHECK(progress > before);

    // An exception of a callback comes out of the step, which has kept what was done.
    bool caught = false;
    const double time = moved.time();
    c.progress = [](const urlsph_progress&) { throw std::runtime_error("stop here"); };
    moved.set_callbacks(c);
    try {
        moved.step(1.0);
    } catch (const std::runtime_error& e) {
        caught = std::string(e.what()) == "stop here";
    }
    CHECK(caught && moved.time() > time && moved.time() < time + 2 * dt);
    moved.set_callbacks({});
    moved.step(dt);
}

void threads() {
    urlsph::Simulation s = create(1);
    std::atomic<bool> running{false}, stop{false};
    urlsph::Callbacks c;
    c.progress = [&](const urlsph_progress&) { running = true; };
    c.cancel = [&] { return stop.load(); };
    s.set_callbacks(c);
    std::atomic<int> code{-1};
    std::thread worker([&] {
        code = thrown([&] { s.advance_to(1e9); }).code();
        running = true;
    });
    while (!running) std::this_thread::yield();
    const urlsph_status busy = thrown([&] { (void)s.time(); }).code();
    stop = true;
    worker.join();
    CHECK(busy == URLSPH_BUSY && code == URLSPH_CANCELLED);
    CHECK(s.time() > 0.0);

    // One simulation per thread.
    std::array<std::uint64_t, 4> hashes{};
    std::vector<std::thread> workers;
    for (std::uint64_t& hash : hashes) {
        workers.emplace_back([&hash] {
            urlsph::Simulation mine = create(1);
            mine.set_traction(mine.patch("top"), {1e4, 0.0, 0.0});
            mine.step(2e-3);
            hash = mine.state_hash();
        });
    }
    for (std::thread& w : workers) w.join();
    CHECK(std::count(hashes.begin(), hashes.end(), hashes[0]) == 4);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "usage: %s SCENE.json METAL.json CONTACT.json\n", argv[0]);
        return 2;
    }
    scene_path = argv[1];
    metal_path = argv[2];
    contact_path = argv[3];
    RUN(creation);
    RUN(ownership);
    RUN(queries);
    RUN(heat);
    RUN(contact);
    RUN(snapshots);
    RUN(callbacks);
    RUN(threads);
    return check_summary();
}
