/* The side that asks for an association. */
#ifndef CTS_NET_SCU_HPP
#define CTS_NET_SCU_HPP

#include <dcmtk/config/osconfig.h>

#include "output/net/transport.hpp"

#include <dcmtk/dcmnet/scu.h>
#include <vector>

/* What an association goes over outlives it. */
struct CtsScuTransport {
    std::unique_ptr<DcmTransportLayer> transport;
};

class CtsScu : protected CtsScuTransport, public DcmSCU
{
  public:
    /* To be offered: a model of queries, in the plain syntaxes. */
    void offer(const char *model);
    /* An association for what was offered. The failure's status is `fault`; *again: another try may do better. */
    CtsStatus associate(const CtsPeer &peer, const CtsNet &net, CtsStatus fault, bool *again, CtsError *err);
    void hang_up(bool in_peace);
    /* The answers to a query of one level (C-FIND), at most so many. */
    CtsStatus ask(DcmDataset &query, size_t most, CtsError *err);
    std::vector<std::unique_ptr<DcmDataset>> answers;

  protected:
    OFCondition handleFINDResponse(const T_ASC_PresentationContextID, QRResponse *response, OFBool &goes_on) override;

  private:
    size_t most_answers = 0;
    Uint16 query_status = STATUS_Success;
};

/* C-FIND: the series that a query names (PS3.4 C, study root). */
CtsStatus cts_dimse_find(const CtsPeer &peer, const CtsNet &net, const CtsSeriesQuery &query, CtsFound &found,
                         CtsError *err);

#endif
