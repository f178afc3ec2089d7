#include "output/net/scu.hpp"

std::string cts_scu_refusal(const OFCondition &state)
{
    std::string text = cts_one_line(state);
    if (text.find("Rejected") != std::string::npos)
        text += " (the peer must know the AE title that `aet` gives, and its own must be the one asked for)";
    if (state.module() == OFM_dcmtls)
        text += " (the peer's certificate must be signed by `tls-ca`, and name the host as it was asked for)";
    return text;
}

void cts_scu_set_up(DcmSCU &scu, const CtsPeer &peer, const CtsNet &net)
{
    scu.setAETitle(net.own_aet);
    scu.setPeerAETitle(peer.aet);
    scu.setPeerHostName(peer.host);
    scu.setPeerPort(static_cast<Uint16>(peer.port));
    scu.setConnectionTimeout(net.timeout_s);
    scu.setACSETimeout(static_cast<Uint32>(net.timeout_s));
    scu.setDIMSETimeout(static_cast<Uint32>(net.timeout_s));
    scu.setDIMSEBlockingMode(DIMSE_NONBLOCKING);
}

OFCondition cts_scu_connect(CtsScu &scu, DcmTransportLayer *transport)
{
    OFCondition state = scu.initNetwork();
    if (state.good())
        state = scu.useSecureConnection(transport);
    return state.good() ? scu.negotiateAssociation() : state;
}

void cts_scu_hang_up(DcmSCU &scu, bool in_peace)
{
    if (scu.isConnected() && in_peace)
        scu.releaseAssociation();
    else if (scu.isConnected())
        scu.abortAssociation();
}
