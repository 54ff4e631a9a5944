/* The header alone, twice, first thing in a C11 file, with all warnings as errors. */
#include <urlsph.h>
#include <urlsph.h>

_Static_assert(sizeof(urlsph_status) == 4, "the enums have a fixed size");
_Static_assert(sizeof(urlsph_quantity) == 4, "the enums have a fixed size");
_Static_assert(URLSPH_OK == 0, "success is 0");

int header_in_c(void);
int header_in_c(void) { return URLSPH_ABI_VERSION; }
