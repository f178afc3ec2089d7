/* C-FIND: the series that a query names (PS3.4 C, study root). */
#ifndef CTS_NET_FIND_HPP
#define CTS_NET_FIND_HPP

#include "output/net/peer.h"

CtsStatus cts_dimse_find(const CtsPeer &peer, const CtsNet &net, const CtsSeriesQuery &query, CtsFound &found,
                         CtsError *err);

#endif
