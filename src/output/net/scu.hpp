/* The side that asks for an association. */
#ifndef CTS_NET_SCU_HPP
#define CTS_NET_SCU_HPP

#include <dcmtk/config/osconfig.h>

#include "output/net/transport.hpp"

#include <dcmtk/dcmnet/scu.h>
#include <string>

class CtsScu : public DcmSCU
{
  public:
    using DcmSCU::useSecureConnection;
};

void cts_scu_set_up(DcmSCU &scu, const CtsPeer &peer, const CtsNet &net);
OFCondition cts_scu_connect(CtsScu &scu, DcmTransportLayer *transport);
void cts_scu_hang_up(DcmSCU &scu, bool in_peace);
/* Why there is no association. A peer that knows only some callers says no more than that it rejects this one. */
std::string cts_scu_refusal(const OFCondition &state);

#endif
