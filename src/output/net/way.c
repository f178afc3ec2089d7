#include "base/load_part.h"
#include "input/header/dcm_readers.h"
#include "output/net/peer.h"

#include <string.h>

CtsStatus cts_way_find(const CtsPeer *peer, const CtsWay **way, CtsError *err)
{
    void *symbol;
    cts_net_way_fn find;
    CtsStatus st = cts_part_load(CTS_NET_PART, "cts_net_way", &symbol, err);
    if (st)
        return cts_context(err, "what talks to a PACS");
    const CtsDcmReaders *dcm = NULL;
    if ((st = cts_dcm_readers(&dcm, err)) || (st = dcm->start(err)))
        return st;
    memcpy(&find, &symbol, sizeof find);
    *way = find(peer->web);
    return CTS_OK;
}
