#include "dicom/net/dcmtk_dimse.hpp"

#include <dcmtk/dcmnet/dcmtrans.h>
#include <dcmtk/dcmtls/tlslayer.h>
#include <dcmtk/dcmtls/tlstrans.h>
#include <netinet/tcp.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/socket.h>

std::string cts_one_line(const OFCondition &state)
{
    std::string text = state.text();
    for (size_t at; (at = text.find('\n')) != std::string::npos;)
        text.replace(at, 1, "; ");
    return text;
}

namespace
{

/* Nagle's algorithm on one side and delayed acknowledgements on the other cost 40 ms for each command and each answer.
 * The kernel resets the second option with every answer. */
void disable_delays(int socket)
{
    const int on = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(socket, IPPROTO_TCP, TCP_QUICKACK, &on, sizeof on);
}

struct LastSocket {
    int last = -1;
};

template <class Connection> class PromptConnection final : public Connection
{
  public:
    using Connection::Connection;
    ssize_t read(void *bytes, size_t n) override
    {
        disable_delays(this->getSocket());
        return Connection::read(bytes, n);
    }
};

class TcpLayer final : public DcmTransportLayer, public LastSocket
{
  public:
    DcmTransportConnection *createConnection(DcmNativeSocketType socket, OFBool) override
    {
        last = socket;
        return new PromptConnection<DcmTCPConnection>(socket);
    }
};

class TlsLayer final : public DcmTLSTransportLayer, public LastSocket
{
  public:
    using DcmTLSTransportLayer::DcmTLSTransportLayer;
    DcmTransportConnection *createConnection(DcmNativeSocketType socket, OFBool) override
    {
        last = socket;
        SSL *const ssl = SSL_new(getNativeHandle());
        if (!ssl || SSL_set_fd(ssl, socket) != 1) {
            SSL_free(ssl);
            return nullptr;
        }
        return new PromptConnection<DcmTLSConnection>(socket, ssl);
    }
};

constexpr DcmTLSSecurityProfile PROFILE = TSP_Profile_BCP195;

/* DCMTK 3.6.9 checks the length of the certificate's key by the profile. */
OFCondition set_certificate(DcmTLSTransportLayer &tls, const char *file)
{
#if PACKAGE_VERSION_NUMBER >= 369
    return tls.setCertificateFile(file, DCF_Filetype_PEM, PROFILE);
#else
    return tls.setCertificateFile(file, DCF_Filetype_PEM);
#endif
}

CtsStatus take_files(DcmTLSTransportLayer &tls, const CtsNet &net, CtsError *err)
{
    OFCondition state = EC_Normal;
    if (net.tls_key && (state = tls.setPrivateKeyFile(net.tls_key, DCF_Filetype_PEM)).bad())
        return cts_fail(err, CTS_ERR_READ, "%s: is no private key in PEM: %s", net.tls_key,
                        cts_one_line(state).c_str());
    if (net.tls_certificate && (state = set_certificate(tls, net.tls_certificate)).bad())
        return cts_fail(err, CTS_ERR_READ, "%s: is no certificate in PEM: %s", net.tls_certificate,
                        cts_one_line(state).c_str());
    if (net.tls_key && !tls.checkPrivateKeyMatchesCertificate())
        return cts_fail(err, CTS_ERR_USAGE, "%s: is not the key of certificate %s", net.tls_key, net.tls_certificate);
    if (net.tls_ca && (state = tls.addTrustedCertificateFile(net.tls_ca, DCF_Filetype_PEM)).bad())
        return cts_fail(err, CTS_ERR_READ, "%s: holds no certificates in PEM: %s", net.tls_ca,
                        cts_one_line(state).c_str());
    return CTS_OK;
}

/* A certificate for another host is rejected before anything is sent. */
bool expect_host(DcmTLSTransportLayer &tls, const char *host)
{
    X509_VERIFY_PARAM *param = SSL_CTX_get0_param(tls.getNativeHandle());
    X509_VERIFY_PARAM_set_hostflags(param, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    return X509_VERIFY_PARAM_set1_ip_asc(param, host) == 1 || X509_VERIFY_PARAM_set1_host(param, host, 0) == 1;
}

} // namespace

CtsStatus cts_transport_make(const CtsNet &net, T_ASC_NetworkRole role, const char *host,
                             std::unique_ptr<DcmTransportLayer> &transport, CtsError *err)
{
    if (!net.tls_ca && !net.tls_key) {
        transport.reset(new TcpLayer());
        return CTS_OK;
    }
    DcmTLSTransportLayer::initializeOpenSSL();
    TlsLayer *const tls = new TlsLayer(role, nullptr, OFFalse);
    transport.reset(tls);
    tls->setPrivateKeyPasswd("");
    OFCondition state = tls->setTLSProfile(PROFILE);
    if (state.good())
        state = tls->activateCipherSuites();
    if (state.bad() || (host && !expect_host(*tls, host)))
        return cts_fail(err, CTS_ERR_INTERNAL, "TLS cannot be set up: %s", cts_one_line(state).c_str());
    tls->setCertificateVerification(host || net.tls_ca ? DCV_requireCertificate : DCV_ignoreCertificate);
    return take_files(*tls, net, err);
}

void cts_transport_break(DcmTransportLayer &transport)
{
    const LastSocket *const known = dynamic_cast<LastSocket *>(&transport);
    if (known && known->last >= 0)
        shutdown(known->last, SHUT_RDWR);
}
