/* What DIMSE goes over: TLS by the profile of BCP 195, or TCP as it is; neither waits for more to come. */
#ifndef CTS_NET_TRANSPORT_HPP
#define CTS_NET_TRANSPORT_HPP

#include <dcmtk/config/osconfig.h>

#include "output/net/peer.h"

#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmnet/dcmlayer.h>
#include <memory>
#include <string>

/* TLS where net names PEM files. host: who the other side must prove to be, by its certificate; NULL on the side that
 * listens, which with tls_ca asks for any certificate signed by it. */
CtsStatus cts_transport_make(const CtsNet &net, T_ASC_NetworkRole role, const char *host,
                             std::unique_ptr<DcmTransportLayer> &transport, CtsError *err);

/* Ends what goes on over the layer's last connection: reading from it fails from now on. DCMTK has no other way out of
 * an object that comes, for what is thrown through it leaves its memory behind. */
void cts_transport_break(DcmTransportLayer &transport);

/* DCMTK's conditions, and what a peer wrote into them, on one line. */
std::string cts_one_line(const OFCondition &state);

#endif
