/* Tables by the ids of an enum. */
#pragma once

/* const type name[n] = {rows}. New ids are put last in their enum: a table that has no row for one is too short, and
 * does not compile. */
#define CTS_ENUM_TABLE(type, name, n, ...)                                                                             \
    const type name[n] = {__VA_ARGS__};                                                                                \
    _Static_assert(sizeof((const type[]){__VA_ARGS__}) / sizeof(type) == (n), #name ": the last id has no row")
