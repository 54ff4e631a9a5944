// The headers alone, twice, first thing in a C++17 file, with all warnings as errors.
#include <urlsph.hpp>
#include <urlsph.h>
#include <urlsph.hpp>

#include <type_traits>

static_assert(sizeof(urlsph_status) == 4, "the enums have a fixed size");
static_assert(std::is_nothrow_move_constructible_v<urlsph::Simulation>);
static_assert(std::is_nothrow_move_assignable_v<urlsph::Simulation>);
static_assert(!std::is_copy_constructible_v<urlsph::Simulation>);

// Internal linkage of nothing: two files may include the wrapper.
int header_in_cpp();
int header_in_cpp() { return URLSPH_VERSION_MINOR; }
