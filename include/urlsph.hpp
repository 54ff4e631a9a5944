/* SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * urlsph for C++17: a thin layer over urlsph.h. Handles are owned and move-only, failures are
 * exceptions, arrays are vectors and spans. Everything is said in urlsph.h: shapes, units,
 * configurations, threads. Header only; link what urlsph.h needs.
 *
 *     urlsph::Simulation column = urlsph::Simulation::from_file("column.json");
 *     column.set_traction(column.patch("y_max"), {1e4, 0, 0});
 *     column.step(1e-3);
 *     std::vector<double> velocity = column.read_field("velocity");
 */

#ifndef URLSPH_HPP
#define URLSPH_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "urlsph.h"

namespace urlsph {

/// A failed call: what is wrong, where, and what to do about it.
class Error : public std::runtime_error {
public:
    /// From what the library filled in.
    explicit Error(const urlsph_error& e)
        : std::runtime_error(e.text), code_(e.code), path_(e.path), boundary_(e.boundary),
          field_(e.field) {
        if (e.has_particle != 0) particle_ = static_cast<std::size_t>(e.particle);
        if (e.has_position != 0) position_ = {e.position[0], e.position[1], e.position[2]};
        if (e.has_time != 0) time_ = e.time;
    }
    /// From a status that is all there is.
    explicit Error(urlsph_status status)
        : std::runtime_error(urlsph_status_text(status)), code_(status) {}

    /// The status of the call.
    urlsph_status code() const noexcept { return code_; }
    /// JSON path in the scene; empty if unknown.
    const std::string& path() const noexcept { return path_; }
    /// Name of the boundary; empty if unknown.
    const std::string& boundary() const noexcept { return boundary_; }
    /// Name of the field; empty if unknown.
    const std::string& field() const noexcept { return field_; }
    /// Particle, 0-based.
    std::optional<std::size_t> particle() const noexcept { return particle_; }
    /// Current position of that particle [m].
    std::optional<std::array<double, 3>> position() const noexcept { return position_; }
    /// Simulated time [s].
    std::optional<double> time() const noexcept { return time_; }

private:
    urlsph_status code_;
    std::string path_, boundary_, field_;
    std::optional<std::size_t> particle_;
    std::optional<std::array<double, 3>> position_;
    std::optional<double> time_;
};

/// Read-only contiguous values that somebody else owns: a vector, an array, or a pointer and a size.
/// To be used as a parameter, for the time of a call.
template <class T>
class Span {
public:
    Span(const T* data, std::size_t size) noexcept : data_(data), size_(size) {}
    template <class Container,
              class = std::enable_if_t<std::is_convertible_v<
                  decltype(std::declval<const Container&>().data()), const T*>>>
    Span(const Container& c) noexcept : data_(c.data()), size_(c.size()) {}

    const T* data() const noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }

private:
    const T* data_;
    std::size_t size_;
};

/// How to create a simulation.
struct Options {
    /// Texts `path=value`, applied to the scene before it is validated.
    std::vector<std::string> overrides;
    /// Threads; 0 for one per core.
    std::size_t threads = 0;
};

/// What a simulation calls, on the thread that calls the simulation. An exception thrown here stops
/// the step and is thrown again by the call that made the step.
struct Callbacks {
    /// Receives log messages.
    std::function<void(const urlsph_log_record&)> log;
    /// Is called after each time step.
    std::function<void(const urlsph_progress&)> progress;
    /// Is asked after each time step; true ends the call with URLSPH_CANCELLED.
    std::function<bool()> cancel;
};

/// A body in motion. Not for several threads at a time: see urlsph.h.
class Simulation {
public:
    /// From the JSON text of a scene.
    static Simulation from_json(const std::string& json, const Options& options = {}) {
        return create(urlsph_create_from_json, json, options);
    }
    /// From the file of a scene.
    static Simulation from_file(const std::string& path, const Options& options = {}) {
        return create(urlsph_create_from_file, path, options);
    }

    Simulation(Simulation&& other) noexcept
        : handle_(std::exchange(other.handle_, nullptr)), calls_(std::move(other.calls_)) {}
    Simulation& operator=(Simulation&& other) noexcept {
        if (this != &other) {
            release();
            handle_ = std::exchange(other.handle_, nullptr);
            calls_ = std::move(other.calls_);
        }
        return *this;
    }
    Simulation(const Simulation&) = delete;
    Simulation& operator=(const Simulation&) = delete;
    ~Simulation() { release(); }

    /// The handle, for calls of urlsph.h; still owned by this object.
    urlsph_simulation* handle() const noexcept { return handle_; }

    /// Sets the callbacks; an empty one is not called.
    void set_callbacks(Callbacks callbacks) {
        auto calls = std::make_unique<Calls>();
        calls->callbacks = std::move(callbacks);
        urlsph_callbacks c = {};
        c.user_data = calls.get();
        if (calls->callbacks.log) c.log = Calls::log;
        if (calls->callbacks.progress) c.progress = Calls::progress;
        // Also the way out for an exception that another callback has thrown.
        c.cancel = Calls::cancel;
        check(urlsph_set_callbacks(handle_, &c, sizeof c));
        calls_ = std::move(calls);
    }

    /// Title of the scene.
    std::string title() const {
        const char* text = nullptr;
        check(urlsph_get_title(handle_, &text));
        return text;
    }
    /// Sizes.
    urlsph_counts counts() const { return get<urlsph_counts>(urlsph_get_counts); }
    /// Simulated time [s].
    double time() const { return value<double>(urlsph_get_time); }
    /// End of the run that the scene describes [s].
    double end_time() const { return value<double>(urlsph_get_end_time); }
    /// Largest stable time step [s].
    double stable_step() const { return value<double>(urlsph_get_stable_step); }
    /// Energies [J] and entropies [J/K].
    urlsph_energies energies() const { return get<urlsph_energies>(urlsph_get_energies); }
    /// Momenta [kg m/s], [kg m^2/s].
    urlsph_momenta momenta() const { return get<urlsph_momenta>(urlsph_get_momenta); }
    /// Generation of the state.
    std::uint64_t generation() const { return value<std::uint64_t>(urlsph_get_generation); }
    /// Hash of the complete state.
    std::uint64_t state_hash() const { return value<std::uint64_t>(urlsph_get_state_hash); }

    /// Index of a patch.
    std::size_t patch(const std::string& name) const { return find(urlsph_find_patch, name); }
    /// Name, particles and area of a patch.
    urlsph_patch_info patch_info(std::size_t patch) const {
        return get<urlsph_patch_info>(urlsph_get_patch_info, patch);
    }
    /// Particles of a patch.
    std::vector<std::size_t> patch_particles(std::size_t patch) const {
        return read<std::size_t>(urlsph_read_patch_particles, patch, patch_info(patch).particles);
    }
    /// Tributary areas of a patch [m^2].
    std::vector<double> patch_areas(std::size_t patch) const {
        return read<double>(urlsph_read_patch_areas, patch, patch_info(patch).particles);
    }
    /// Normals of a patch, particles x 3.
    std::vector<double> patch_normals(std::size_t patch) const {
        return read<double>(urlsph_read_patch_normals, patch, 3 * patch_info(patch).particles);
    }
    /// Resultants of a patch.
    urlsph_resultant resultant(std::size_t patch) const {
        return get<urlsph_resultant>(urlsph_get_resultant, patch);
    }
    /// Heat flow [W] and temperatures [K] of a patch; only of a body with heat.
    urlsph_heat_resultant heat_resultant(std::size_t patch) const {
        return get<urlsph_heat_resultant>(urlsph_get_heat_resultant, patch);
    }

    /// Index of a plane of contact.
    std::size_t contact(const std::string& name) const { return find(urlsph_find_contact, name); }
    /// Name, point and normal of a plane of contact.
    urlsph_contact_info contact_info(std::size_t contact) const {
        return get<urlsph_contact_info>(urlsph_get_contact_info, contact);
    }
    /// Force [N], impulse [N s], displacement [m] and touching particles of a plane of contact.
    urlsph_contact_resultant contact_resultant(std::size_t contact) const {
        return get<urlsph_contact_resultant>(urlsph_get_contact_resultant, contact);
    }

    /// Index of a field.
    std::size_t field(const std::string& name) const { return find(urlsph_find_field, name); }
    /// Name, unit, shape and configuration of a field.
    urlsph_field_info field_info(std::size_t field) const {
        return get<urlsph_field_info>(urlsph_get_field_info, field);
    }
    /// A copy of a field, particles x components.
    std::vector<double> read_field(std::size_t field) const {
        return read<double>(urlsph_read_field, field,
                            counts().particles * field_info(field).components);
    }
    /// The same by name.
    std::vector<double> read_field(const std::string& name) const {
        return read_field(field(name));
    }
    /// Copies a field into memory of yours, `capacity` numbers.
    void read_field(std::size_t field, double* values, std::size_t capacity) const {
        check(urlsph_read_field(handle_, field, values, capacity));
    }
    /// A look at the memory of a field; stale once `generation()` is another.
    urlsph_view view(std::size_t field) const { return get<urlsph_view>(urlsph_get_view, field); }

    /// Index of a probe.
    std::size_t probe(const std::string& name) const { return find(urlsph_find_probe, name); }
    /// Name and initial position of a probe.
    urlsph_probe_info probe_info(std::size_t probe) const {
        return get<urlsph_probe_info>(urlsph_get_probe_info, probe);
    }
    /// Displacement, velocity and temperature of a probe.
    urlsph_probe_motion probe_motion(std::size_t probe) const {
        return get<urlsph_probe_motion>(urlsph_get_probe_motion, probe);
    }

    /// Patch, quantity and shape of an input.
    urlsph_input_info input_info(std::size_t input) const {
        return get<urlsph_input_info>(urlsph_get_input_info, input);
    }
    /// Present values of an input.
    std::vector<double> input(std::size_t patch, urlsph_quantity quantity) const {
        std::vector<double> values(3 * patch_info(patch).particles);
        std::size_t count = 0;
        check(urlsph_read_input(handle_, patch, quantity, values.data(), values.size(), &count));
        values.resize(count);
        return values;
    }
    /// Sets a traction [Pa], one for the patch.
    void set_traction(std::size_t patch, const std::array<double, 3>& value) {
        set_traction(patch, Span<double>(value));
    }
    /// Sets a traction [Pa]: 3 numbers, or 3 per particle of the patch.
    void set_traction(std::size_t patch, Span<double> values) {
        check(urlsph_set_traction(handle_, patch, values.data(), values.size()));
    }
    /// Sets a pressure [Pa], one for the patch.
    void set_pressure(std::size_t patch, double value) {
        set_pressure(patch, Span<double>(&value, 1));
    }
    /// Sets a pressure [Pa]: 1 number, or 1 per particle of the patch.
    void set_pressure(std::size_t patch, Span<double> values) {
        check(urlsph_set_pressure(handle_, patch, values.data(), values.size()));
    }
    /// Sets a velocity [m/s], one for the patch.
    void set_velocity(std::size_t patch, const std::array<double, 3>& value) {
        set_velocity(patch, Span<double>(value));
    }
    /// Sets a velocity [m/s]: 3 numbers, or 3 per particle of the patch.
    void set_velocity(std::size_t patch, Span<double> values) {
        check(urlsph_set_velocity(handle_, patch, values.data(), values.size()));
    }
    /// Sets a heat flux into the body [W/m^2], one for the patch.
    void set_heat_flux(std::size_t patch, double value) {
        set_heat_flux(patch, Span<double>(&value, 1));
    }
    /// Sets a heat flux into the body [W/m^2]: 1 number, or 1 per particle of the patch.
    void set_heat_flux(std::size_t patch, Span<double> values) {
        check(urlsph_set_heat_flux(handle_, patch, values.data(), values.size()));
    }
    /// Sets an absolute temperature [K], one for the patch.
    void set_temperature(std::size_t patch, double value) {
        set_temperature(patch, Span<double>(&value, 1));
    }
    /// Sets an absolute temperature [K]: 1 number, or 1 per particle of the patch.
    void set_temperature(std::size_t patch, Span<double> values) {
        check(urlsph_set_temperature(handle_, patch, values.data(), values.size()));
    }
    /// Sets the convection: coefficient [W/(m^2 K)] and ambient temperature [K], one for the patch.
    void set_convection(std::size_t patch, double coefficient, double ambient_temperature) {
        set_convection(patch, Span<double>(&coefficient, 1), Span<double>(&ambient_temperature, 1));
    }
    /// Sets the convection: each 1 number, or 1 per particle of the patch.
    void set_convection(std::size_t patch, Span<double> coefficients,
                        Span<double> ambient_temperatures) {
        check(urlsph_set_convection(handle_, patch, coefficients.data(), coefficients.size(),
                                    ambient_temperatures.data(), ambient_temperatures.size()));
    }
    /// Sets the coefficient of the convection alone [W/(m^2 K)], one for the patch.
    void set_convection_coefficient(std::size_t patch, double value) {
        set_convection_coefficient(patch, Span<double>(&value, 1));
    }
    /// Sets the coefficient of the convection alone: 1 number, or 1 per particle of the patch.
    void set_convection_coefficient(std::size_t patch, Span<double> values) {
        check(urlsph_set_convection(handle_, patch, values.data(), values.size(), nullptr, 0));
    }
    /// Sets the ambient temperature of the convection alone [K], one for the patch.
    void set_ambient_temperature(std::size_t patch, double value) {
        set_ambient_temperature(patch, Span<double>(&value, 1));
    }
    /// Sets the ambient temperature of the convection alone: 1 number, or 1 per particle.
    void set_ambient_temperature(std::size_t patch, Span<double> values) {
        check(urlsph_set_convection(handle_, patch, nullptr, 0, values.data(), values.size()));
    }

    /// Advances by dt [s].
    void step(double dt) { check(urlsph_step(handle_, dt)); }
    /// Advances to a time [s].
    void advance_to(double time) { check(urlsph_advance_to(handle_, time)); }

    /// The complete state.
    std::vector<std::uint8_t> snapshot() const {
        std::size_t size = value<std::size_t>(urlsph_get_snapshot_size);
        std::vector<std::uint8_t> bytes(size);
        check(urlsph_save_snapshot(handle_, bytes.data(), bytes.size(), &size));
        return bytes;
    }
    /// Returns to a complete state.
    void restore(Span<std::uint8_t> snapshot) {
        check(urlsph_restore_snapshot(handle_, snapshot.data(), snapshot.size()));
    }
    /// Writes the complete state to a file, which is there when all of it is, or stays as it was.
    void save_snapshot(const std::string& path) const {
        check(urlsph_save_snapshot_to_file(handle_, path.c_str()));
    }
    /// Returns to the complete state in a file.
    void restore_snapshot(const std::string& path) {
        check(urlsph_restore_snapshot_from_file(handle_, path.c_str()));
    }

private:
    /// Destroys the simulation. While a call is under way on it, from a callback of its own say, it
    /// stays, and with it what that call goes on using.
    void release() noexcept {
        if (urlsph_destroy(std::exchange(handle_, nullptr)) == URLSPH_BUSY) calls_.release();
    }

    /// The callbacks at an address that stays, and what they threw.
    struct Calls {
        Callbacks callbacks;
        std::exception_ptr thrown;

        template <class F>
        static void guard(void* self, F f) noexcept {
            auto* calls = static_cast<Calls*>(self);
            if (calls->thrown) return;
            try {
                f(calls->callbacks);
            } catch (...) {
                calls->thrown = std::current_exception();
            }
        }
        static void log(const urlsph_log_record* record, void* self) {
            guard(self, [&](Callbacks& c) { c.log(*record); });
        }
        static void progress(const urlsph_progress* p, void* self) {
            guard(self, [&](Callbacks& c) { c.progress(*p); });
        }
        static std::int32_t cancel(void* self) {
            bool stop = false;
            guard(self, [&](Callbacks& c) { stop = c.cancel && c.cancel(); });
            return stop || static_cast<Calls*>(self)->thrown ? 1 : 0;
        }
    };

    explicit Simulation(urlsph_simulation* handle) noexcept : handle_(handle) {}

    template <class Create>
    static Simulation create(Create call, const std::string& text, const Options& options) {
        std::vector<const char*> overrides;
        overrides.reserve(options.overrides.size());
        for (const std::string& o : options.overrides) overrides.push_back(o.c_str());
        urlsph_options o = {};
        o.overrides = overrides.data();
        o.override_count = overrides.size();
        o.threads = options.threads;
        urlsph_simulation* handle = nullptr;
        urlsph_error error;
        if (call(text.c_str(), &o, sizeof o, &handle, &error, sizeof error) != URLSPH_OK) {
            throw Error(error);
        }
        return Simulation(handle);
    }

    void check(urlsph_status status) const {
        // It leaves no error behind, and what a callback has thrown belongs to the call under way.
        if (status == URLSPH_BUSY) throw Error(status);
        // What a callback has thrown during the call is the better story.
        if (calls_ && calls_->thrown) std::rethrow_exception(std::exchange(calls_->thrown, {}));
        if (status == URLSPH_OK) return;
        urlsph_error error;
        // A wrong handle leaves no error behind: then the status is all there is.
        if (urlsph_get_last_error(handle_, &error, sizeof error) != URLSPH_OK ||
            error.code != status) {
            throw Error(status);
        }
        throw Error(error);
    }

    template <class T, class Call>
    T value(Call call) const {
        T v = {};
        check(call(handle_, &v));
        return v;
    }
    template <class T, class Call, class... Index>
    T get(Call call, Index... index) const {
        T v = {};
        check(call(handle_, index..., &v, sizeof v));
        return v;
    }
    template <class Call>
    std::size_t find(Call call, const std::string& name) const {
        std::size_t index = 0;
        check(call(handle_, name.c_str(), &index));
        return index;
    }
    template <class T, class Call>
    std::vector<T> read(Call call, std::size_t index, std::size_t count) const {
        std::vector<T> values(count);
        check(call(handle_, index, values.data(), values.size()));
        return values;
    }

    urlsph_simulation* handle_ = nullptr;
    std::unique_ptr<Calls> calls_;
};

}  // namespace urlsph

#endif  /* URLSPH_HPP */
