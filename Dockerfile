# armdyn and what it needs, a C compiler among it: functions become machine code when they are first used.
#
#   docker build -t armdyn .
#   docker run --rm -v "$PWD/results:/results" armdyn reproduce --out /results
FROM python:3.12-slim-bookworm AS wheel
RUN apt-get update -q && apt-get install -q -y --no-install-recommends g++ && rm -rf /var/lib/apt/lists/*
COPY . /armdyn
RUN pip wheel --no-cache-dir --no-deps -w /wheels /armdyn

FROM python:3.12-slim-bookworm
RUN apt-get update -q && apt-get install -q -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
COPY --from=wheel /wheels /wheels
RUN pip install --no-cache-dir /wheels/*.whl && useradd --create-home armdyn
USER armdyn
WORKDIR /home/armdyn
ENTRYPOINT ["armdyn"]
CMD ["--help"]
