/* What the library of the ways shows of itself. */
#include "output/net/peer.h"

__attribute__((visibility("default"))) const CtsWay *cts_net_way(bool web)
{
    return web ? &cts_way_web : &cts_way_dimse;
}
