# armdyn and what it needs, a C compiler among it: functions become machine code when they are first used.
#
#   docker build -t armdyn . && mkdir -p results
#   docker run --rm -u "$(id -u)" -e HOME=/results -v "$PWD/results:/results" armdyn \
#     mintime ur5 --q-start home --q-goal 90deg,-45deg,60deg,-90deg,0,0 --out /results/ur5
#   docker run --rm -u "$(id -u)" -e HOME=/results -v "$PWD/results:/results" armdyn reproduce --out /results
#
# With your user the results are yours; machine code is kept in HOME from one run to the next.
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
