/* TLS for DIMSE, by the profile of BCP 195. */
#ifndef CTS_NET_TLS_HPP
#define CTS_NET_TLS_HPP

#include <dcmtk/config/osconfig.h>

#include "output/net/peer.h"

#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmtls/tlslayer.h>
#include <memory>
#include <string>

/* A layer from the PEM files that net names; NULL where it names none. host: who the other side must prove to be, by
 * its certificate; NULL on the side that listens, which with tls_ca asks for any certificate signed by it. */
CtsStatus cts_tls_make(const CtsNet &net, T_ASC_NetworkRole role, const char *host,
                       std::unique_ptr<DcmTLSTransportLayer> &tls, CtsError *err);

/* DCMTK's conditions, and what a peer wrote into them, on one line. */
std::string cts_one_line(const OFCondition &state);

#endif
